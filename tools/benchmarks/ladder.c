/* The rung that a C programmer would write in an hour: candump text of the four messages of the
 * ladder's recording to arrays of doubles, checksum and counter of each frame checked.
 *
 * usage: ladder FILE [SECONDS]; prints one line of JSON as _passes.py does. gcc -O2, one core.
 */
#include <fcntl.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

enum { MESSAGES = 4, SIGNALS = 5, MOST_PASSES = 1000 };

typedef struct {
    const char *name;
    uint16_t start, length;
    int is_signed;
    double scale;
} signal_t;

typedef struct {
    const char *name;
    uint32_t id;
    signal_t signals[SIGNALS];
} message_t;

#define CHECKS {"Crc", 0, 8, 0, 1}, {"Alive", 8, 4, 0, 1}
static const message_t MESSAGE[MESSAGES] = {
    {"WheelSpeeds1", 0x101, {CHECKS, {"WheelSpeed_Ax1", 16, 16, 0, 0.002},
        {"WheelSpeed_Ax2", 32, 16, 0, 0.002}, {"WheelSpeed_Ax3", 48, 16, 0, 0.002}}},
    {"VehicleSpeed", 0x111, {CHECKS, {"VehicleSpeed", 16, 16, 0, 0.002},
        {"VehicleSpeedSource", 32, 4, 0, 1}, {"Direction", 36, 2, 0, 1}}},
    {"TractiveEffort1", 0x121, {CHECKS, {"TractiveEffort_Ax1", 16, 16, 1, 10},
        {"TractiveEffort_Ax2", 32, 16, 1, 10}, {"TractiveEffort_Ax3", 48, 16, 1, 10}}},
    {"AxleLoads1", 0x131, {CHECKS, {"AxleLoad_Ax1", 16, 16, 0, 10},
        {"AxleLoad_Ax2", 32, 16, 0, 10}, {"AxleLoad_Ax3", 48, 16, 0, 10}}},
};

/* What is kept of a message. */
typedef struct {
    size_t count, room;
    int64_t *t_us;
    double *values[SIGNALS];
    int baseline;
} columns_t;

static uint8_t crc_table[256], digit_of[256];
static uint8_t slot_of[2048]; /* 1 + place in MESSAGE, by id */

static void make_tables(void)
{
    for (int value = 0; value < 256; value++) {
        unsigned crc = value;
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 0x80 ? (crc << 1 ^ 0x1D) & 0xFF : crc << 1;
        crc_table[value] = crc;
    }
    memset(digit_of, 0xFF, sizeof digit_of);
    for (int digit = 0; digit < 16; digit++) {
        digit_of[(uint8_t)"0123456789ABCDEF"[digit]] = digit;
        digit_of[(uint8_t)"0123456789abcdef"[digit]] = digit;
    }
    for (int place = 0; place < MESSAGES; place++)
        slot_of[MESSAGE[place].id] = 1 + place;
}

static void *must(void *memory)
{
    if (!memory) {
        perror("ladder");
        exit(2);
    }
    return memory;
}

static void grow(columns_t *columns)
{
    columns->room = columns->room ? 2 * columns->room : 1 << 16;
    columns->t_us = must(realloc(columns->t_us, columns->room * sizeof *columns->t_us));
    for (int place = 0; place < SIGNALS; place++)
        columns->values[place] =
            must(realloc(columns->values[place], columns->room * sizeof(double)));
}

typedef struct {
    size_t frames, bad_lines, bad_checksums, bad_counters, lost;
} counts_t;

/* One line, "(seconds.micros) bus id#payload"; 0 where it has another form. */
static int read_line(const uint8_t *at, const uint8_t *end, int64_t *t_us, uint32_t *id,
                     uint8_t payload[8])
{
    int64_t stamp = 0;
    if (at == end || *at++ != '(')
        return 0;
    for (; at < end && digit_of[*at] < 10; at++)
        stamp = 10 * stamp + digit_of[*at];
    if (end - at < 8 || *at++ != '.')
        return 0;
    for (int place = 0; place < 6; place++) {
        uint8_t digit = digit_of[*at++];
        if (digit > 9)
            return 0;
        stamp = 10 * stamp + digit;
    }
    if (*at++ != ')')
        return 0;
    while (at < end && *at == ' ')
        at++;
    while (at < end && *at != ' ')
        at++;
    while (at < end && *at == ' ')
        at++;
    *id = 0;
    for (; at < end && digit_of[*at] < 16; at++)
        *id = *id << 4 | digit_of[*at];
    if (end - at != 17 || *at++ != '#')
        return 0;
    unsigned wrong = 0;
    for (int place = 0; place < 8; place++, at += 2) {
        uint8_t high = digit_of[at[0]], low = digit_of[at[1]];
        wrong |= high | low;
        payload[place] = high << 4 | low;
    }
    *t_us = stamp;
    return wrong < 16;
}

static int checksum_ok(const uint8_t payload[8], uint32_t id)
{
    uint8_t crc = crc_table[crc_table[id & 0xFF] ^ (id >> 8)];
    for (int place = 1; place < 8; place++)
        crc = crc_table[crc ^ payload[place]];
    return crc == payload[0];
}

/* Profile 1 without taking over a new count: the recording needs none. */
static int counter_ok(columns_t *columns, int count, counts_t *counts)
{
    int step = columns->baseline < 0 ? 1 : (count - columns->baseline + 15) % 15;
    if (count > 14 || step < 1 || step > 3)
        return 0;
    counts->lost += step - 1;
    columns->baseline = count;
    return 1;
}

static void decode(const message_t *message, columns_t *columns, int64_t t_us, uint64_t word)
{
    if (columns->count == columns->room)
        grow(columns);
    size_t row = columns->count++;
    columns->t_us[row] = t_us;
    for (int place = 0; place < SIGNALS; place++) {
        const signal_t *signal = &message->signals[place];
        uint64_t raw = word << (64 - signal->start - signal->length);
        int rest = 64 - signal->length;
        columns->values[place][row] = signal->is_signed
            ? (double)((int64_t)raw >> rest) * signal->scale
            : (double)(int64_t)(raw >> rest) * signal->scale;
    }
}

static counts_t read_all(const uint8_t *text, size_t size, columns_t columns[MESSAGES])
{
    counts_t counts = {0};
    const uint8_t *at = text, *stop = text + size;
    while (at < stop) {
        const uint8_t *end = memchr(at, '\n', stop - at);
        if (!end)
            end = stop;
        int64_t t_us;
        uint32_t id;
        uint8_t payload[8];
        uint64_t word;
        if (!read_line(at, end, &t_us, &id, payload)) {
            counts.bad_lines++;
        } else if (id < 2048 && slot_of[id]) {
            int slot = slot_of[id] - 1;
            if (!checksum_ok(payload, id)) {
                counts.bad_checksums++;
            } else if (!counter_ok(&columns[slot], payload[1] & 0x0F, &counts)) {
                counts.bad_counters++;
            } else {
                memcpy(&word, payload, sizeof word); /* little-endian */
                decode(&MESSAGE[slot], &columns[slot], t_us, word);
                counts.frames++;
            }
        }
        at = end + 1;
    }
    return counts;
}

static double now(clockid_t clock)
{
    struct timespec time;
    clock_gettime(clock, &time);
    return time.tv_sec + 1e-9 * time.tv_nsec;
}

/* A pass over the file: map, read, keep. */
static counts_t pass(const char *path, columns_t columns[MESSAGES])
{
    struct stat about;
    int file = open(path, O_RDONLY);
    if (file < 0 || fstat(file, &about)) {
        perror(path);
        exit(2);
    }
    for (int place = 0; place < MESSAGES; place++) {
        memset(&columns[place], 0, sizeof columns[place]);
        columns[place].baseline = -1;
    }
    uint8_t *text = mmap(NULL, about.st_size, PROT_READ, MAP_PRIVATE | MAP_POPULATE, file, 0);
    if (text == MAP_FAILED) {
        perror(path);
        exit(2);
    }
    counts_t counts = read_all(text, about.st_size, columns);
    munmap(text, about.st_size);
    close(file);
    return counts;
}

static void let_go(columns_t columns[MESSAGES])
{
    for (int slot = 0; slot < MESSAGES; slot++) {
        free(columns[slot].t_us);
        for (int place = 0; place < SIGNALS; place++)
            free(columns[slot].values[place]);
    }
}

static long peak_kib(void)
{
    char line[200];
    long kib = 0;
    FILE *status = fopen("/proc/self/status", "r");
    while (status && fgets(line, sizeof line, status))
        sscanf(line, "VmHWM: %ld", &kib);
    if (status)
        fclose(status);
    return kib;
}

int main(int argc, char **argv)
{
    static columns_t columns[MESSAGES];
    static double clock[MOST_PASSES], processor[MOST_PASSES];
    if (argc < 2) {
        fprintf(stderr, "usage: ladder FILE [SECONDS]\n");
        return 2;
    }
    double spend = argc > 2 ? atof(argv[2]) : 0, spent = 0;
    int passes = 0;
    counts_t counts = {0};
    make_tables();
    do {
        let_go(columns);
        double wall = now(CLOCK_MONOTONIC), work = now(CLOCK_PROCESS_CPUTIME_ID);
        counts = pass(argv[1], columns);
        clock[passes] = now(CLOCK_MONOTONIC) - wall;
        processor[passes] = now(CLOCK_PROCESS_CPUTIME_ID) - work;
        spent += clock[passes++];
    } while (spent < spend && passes < MOST_PASSES);
    printf("{\"frames\": %zu, \"bad_lines\": %zu, \"bad_checksums\": %zu, \"bad_counters\": %zu, "
           "\"lost\": %zu, \"mib\": %.1f, \"passes\": [",
           counts.frames, counts.bad_lines, counts.bad_checksums, counts.bad_counters, counts.lost,
           peak_kib() / 1024.0);
    for (int place = 0; place < passes; place++)
        printf("%s[%.9f, %.9f]", place ? ", " : "", clock[place], processor[place]);
    printf("], \"sums\": {");
    for (int slot = 0; slot < MESSAGES; slot++)
        for (int place = 0; place < SIGNALS; place++) {
            long double sum = 0;
            for (size_t row = 0; row < columns[slot].count; row++)
                sum += columns[slot].values[place][row];
            printf("%s\"%s.%s\": %.12Lg", slot || place ? ", " : "", MESSAGE[slot].name,
                   MESSAGE[slot].signals[place].name, sum);
        }
    printf("}}\n");
    return 0;
}
