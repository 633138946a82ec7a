/* An FMU whose model is a Python process: it starts the process, keeps the values that the host
   sets and gets, and exchanges them at each step.

   The process says hello with {protocol, number of variables or -1, length of a text}, the text
   (the GUID, or what is wrong), and {type, causality, start value} of each variable. A request is
   {command, time, step} and the values of parameters and inputs; an answer is {0 or 1, length of a
   text}, the values of the outputs, and the text (what is wrong). All numbers are doubles. */
#include "fmi2.h"
#include "process.h"

#include <ctype.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { PROTOCOL = 1, MOST_VARIABLES = 100000, MOST_TEXT = 4000, LONGEST_PATH = 3000 };
enum { SET_UP = 1, STEP = 2 };
/* Names that windows.h has not taken. */
enum { A_REAL, AN_INTEGER, A_BOOLEAN, AN_ENUMERATION };
enum { A_PARAMETER, AN_INPUT, AN_OUTPUT };
enum { STARTING_S = 120, STEPPING_S = 60, LONGEST_S = 1000000 };

typedef enum { INSTANTIATED, INITIALIZING, STEPPING, TERMINATED, BROKEN } State;

typedef struct {
    State state;
    char *name, *guid, *resources;
    fmi2CallbackLogger logger;
    fmi2ComponentEnvironment environment;
    Process process;
    int is_set_up; /* whether the outputs follow from the values that were set */
    double start_time;
    size_t count, given; /* number of variables; of parameters and inputs, which come first */
    double *rows;        /* type, causality and start value of each */
    double *values;
    double *request, *answer;
} Instance;

static char *copy_of(const char *text) {
    char *copy = malloc(strlen(text) + 1);
    return copy ? strcpy(copy, text) : NULL;
}

/* Give the host a message. It is a format to some hosts and a text to others. */
static fmi2Status report(const Instance *one, fmi2Status status, const char *format, ...) {
    char text[MOST_TEXT + REASON], safe[2 * sizeof text];
    va_list rest;
    va_start(rest, format);
    vsnprintf(text, sizeof text, format, rest);
    va_end(rest);
    char *place = safe;
    for (const char *c = text; *c; c++) {
        if (*c == '%') *place++ = '%';
        *place++ = *c;
    }
    *place = 0;
    if (one->logger) one->logger(one->environment, one->name, status, "logStatusError", safe);
    return status;
}

static fmi2Status fail(Instance *one, const char *what) {
    one->state = BROKEN;
    process_end(&one->process);
    return report(one, fmi2Error, "%s", what);
}

static double seconds_of(const char *variable, double usual) {
    const char *text = getenv(variable);
    double seconds = text ? atof(text) : 0.0;
    return seconds > 0.0 ? fmin(seconds, LONGEST_S) : usual;
}

static int receive(Instance *one, void *bytes, size_t size, double seconds, char *why) {
    return process_receive(&one->process, bytes, size, seconds, why);
}

/* Receive a text of so many bytes. 0, or -1 or LATE with the reason. */
static int receive_text(Instance *one, double length, double seconds, char *text, char *why) {
    if (!(length >= 0 && length < MOST_TEXT)) {
        snprintf(why, REASON, "the Python process does not speak as this FMU does");
        return -1;
    }
    text[(size_t)length] = 0;
    return receive(one, text, (size_t)length, seconds, why);
}

/* The interpreter: of the environment, else that of the export where it is here, else any. */
static const char *find_python(const Instance *one, char *line) {
    char path[LONGEST_PATH + 16];
    const char *named = getenv("ADHESION_CAN_PYTHON");
    if (named && *named) return named;
    snprintf(path, sizeof path, "%s/python.txt", one->resources);
    if (!read_line(path, line, LONGEST_PATH) && file_exists(line)) return line;
    return default_python;
}

static int take_layout(Instance *one, double count, double seconds, char *why) {
    size_t n = (size_t)count;
    free(one->rows), free(one->values), free(one->request), free(one->answer);
    one->rows = calloc(3 * n + 1, sizeof(double));
    one->values = calloc(n + 1, sizeof(double));
    one->request = calloc(n + 3, sizeof(double));
    one->answer = calloc(n + 2, sizeof(double));
    one->count = one->given = 0;
    if (!one->rows || !one->values || !one->request || !one->answer) {
        snprintf(why, REASON, "no memory");
        return -1;
    }
    if (receive(one, one->rows, 3 * n * sizeof(double), seconds, why)) return -1;
    one->count = n;
    for (size_t i = 0; i < n; i++) {
        one->values[i] = one->rows[3 * i + 2];
        if (one->rows[3 * i + 1] != AN_OUTPUT) one->given = i + 1;
    }
    return 0;
}

/* Start the process and take over its variables. 0, or -1 with a message to the host. */
static int start(Instance *one) {
    char why[REASON] = "", text[MOST_TEXT] = "", line[LONGEST_PATH];
    double hello[3], seconds = seconds_of("ADHESION_CAN_TIMEOUT", STARTING_S);
    const char *python = find_python(one, line);
    static const char *const advice =
        "this FMU needs Python 3.11 or later in which adhesion-can is installed; set the "
        "environment variable ADHESION_CAN_PYTHON to the interpreter that has it";
    one->is_set_up = 0;
    if (process_start(&one->process, python, one->resources, why)) {
        report(one, fmi2Error, "%s; %s", why, advice);
        return -1;
    }
    int failed = receive(one, hello, sizeof hello, seconds, why);
    if (failed == LATE) {
        report(one, fmi2Error, "'%s': %s", python, why);
    } else if (failed) {
        report(one, fmi2Error, "%s ('%s'); %s", why, python, advice);
    } else if (hello[0] != PROTOCOL) {
        report(one, fmi2Error, "adhesion-can of '%s' speaks another protocol; export again with it",
               python);
    } else if (receive_text(one, hello[2], seconds, text, why)) {
        report(one, fmi2Error, "%s", why);
    } else if (!(hello[1] >= 0 && hello[1] <= MOST_VARIABLES)) {
        report(one, fmi2Error, "%s", text);
    } else if (strcmp(text, one->guid)) {
        report(one, fmi2Error, "the GUID is %s, not %s: the description is of another FMU", text,
               one->guid);
    } else if (take_layout(one, hello[1], seconds, why)) {
        report(one, fmi2Error, "%s", why);
    } else {
        one->state = INSTANTIATED;
        return 0;
    }
    process_end(&one->process);
    one->state = BROKEN;
    return -1;
}

/* Send a request and take the outputs over from its answer. */
static fmi2Status exchange(Instance *one, double command, double time, double step) {
    char why[REASON] = "", text[MOST_TEXT] = "";
    double seconds = seconds_of("ADHESION_CAN_TIMEOUT", STEPPING_S);
    size_t outputs = one->count - one->given;
    one->request[0] = command, one->request[1] = time, one->request[2] = step;
    memcpy(one->request + 3, one->values, one->given * sizeof(double));
    if (process_send(&one->process, one->request, (3 + one->given) * sizeof(double), seconds, why))
        return fail(one, why);
    if (receive(one, one->answer, (2 + outputs) * sizeof(double), seconds, why) ||
        receive_text(one, one->answer[1], seconds, text, why))
        return fail(one, why);
    if (one->answer[0] != 0.0) return fail(one, text);
    memcpy(one->values + one->given, one->answer + 2, outputs * sizeof(double));
    return fmi2OK;
}

static fmi2Status set_up(Instance *one) {
    if (one->is_set_up) return fmi2OK;
    fmi2Status status = exchange(one, SET_UP, one->start_time, 0.0);
    one->is_set_up = status == fmi2OK;
    return status;
}

static fmi2Status refuse(const Instance *one, const char *function) {
    if (one->state == BROKEN)
        return report(one, fmi2Error, "%s: the Python process has failed; reset or free the FMU",
                      function);
    return report(one, fmi2Error, "%s is not allowed now", function);
}

static fmi2Status unsupported(fmi2Component component, const char *function) {
    return component ? report(component, fmi2Error, "%s is not supported", function) : fmi2Error;
}

/* Path of a URI of a file, without a slash at its end. 0, or -1. */
static int path_of(const char *uri, char *path) {
    const char *c = uri;
    size_t n = 0;
    if (strncmp(c, "file:", 5) == 0) {
        c += 5;
        if (strncmp(c, "//", 2) == 0) {
            c += 2;
            c += strcspn(c, "/"); /* the host, '' or localhost */
        }
        if (c[0] == '/' && c[1] && c[2] == ':') c++; /* /C:/ */
    }
    for (; *c; c++) {
        unsigned int byte = 0;
        if (n + 1 >= LONGEST_PATH) return -1;
        if (*c == '%' && isxdigit((unsigned char)c[1]) && isxdigit((unsigned char)c[2]) &&
            sscanf(c + 1, "%2x", &byte) == 1 && byte) {
            path[n++] = (char)byte;
            c += 2;
        } else {
            path[n++] = *c;
        }
    }
    while (n > 1 && (path[n - 1] == '/' || path[n - 1] == '\\')) n--;
    path[n] = 0;
    return n ? 0 : -1;
}

/* ------------------------------------------------------------------------------- the interface */

EXPORT const char *fmi2GetTypesPlatform(void) { return "default"; }

EXPORT const char *fmi2GetVersion(void) { return "2.0"; }

EXPORT fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean on, size_t n,
                                      const fmi2String categories[]) {
    (void)c, (void)on, (void)n, (void)categories; /* only errors are logged, and always */
    return fmi2OK;
}

EXPORT void fmi2FreeInstance(fmi2Component c) {
    Instance *one = c;
    if (!one) return;
    process_end(&one->process);
    free(one->rows), free(one->values), free(one->request), free(one->answer);
    free(one->name), free(one->guid), free(one->resources);
    free(one);
}

EXPORT fmi2Component fmi2Instantiate(fmi2String name, fmi2Type type, fmi2String guid,
                                     fmi2String location, const fmi2CallbackFunctions *functions,
                                     fmi2Boolean visible, fmi2Boolean logging) {
    char path[LONGEST_PATH];
    (void)visible, (void)logging;
    Instance *one = calloc(1, sizeof *one);
    if (!one) return NULL;
    one->logger = functions ? functions->logger : NULL;
    one->environment = functions ? functions->componentEnvironment : NULL;
    one->name = copy_of(name ? name : "");
    one->guid = copy_of(guid ? guid : "");
    int failed = -1;
    if (type != fmi2CoSimulation)
        report(one, fmi2Error, "this FMU is for co-simulation");
    else if (!location || path_of(location, path))
        report(one, fmi2Error, "the location of the resources is no path of a file");
    else if (one->name && one->guid && (one->resources = copy_of(path)))
        failed = start(one);
    if (!failed) return one;
    fmi2FreeInstance(one);
    return NULL;
}

EXPORT fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean has_tolerance,
                                      fmi2Real tolerance, fmi2Real start_time,
                                      fmi2Boolean has_stop, fmi2Real stop_time) {
    Instance *one = c;
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop_time;
    if (one->state != INSTANTIATED) return refuse(one, "fmi2SetupExperiment");
    if (!isfinite(start_time)) return report(one, fmi2Error, "the start time is no number");
    one->start_time = start_time;
    return fmi2OK;
}

EXPORT fmi2Status fmi2EnterInitializationMode(fmi2Component c) {
    Instance *one = c;
    if (one->state != INSTANTIATED) return refuse(one, "fmi2EnterInitializationMode");
    one->state = INITIALIZING;
    return fmi2OK;
}

EXPORT fmi2Status fmi2ExitInitializationMode(fmi2Component c) {
    Instance *one = c;
    if (one->state != INITIALIZING) return refuse(one, "fmi2ExitInitializationMode");
    fmi2Status status = set_up(one);
    if (status == fmi2OK) one->state = STEPPING;
    return status;
}

EXPORT fmi2Status fmi2Terminate(fmi2Component c) {
    Instance *one = c;
    if (one->state != STEPPING) return refuse(one, "fmi2Terminate");
    one->state = TERMINATED;
    return fmi2OK;
}

EXPORT fmi2Status fmi2Reset(fmi2Component c) {
    Instance *one = c;
    one->start_time = 0.0;
    if (one->state == BROKEN) return start(one) ? fmi2Error : fmi2OK;
    for (size_t i = 0; i < one->count; i++) one->values[i] = one->rows[3 * i + 2];
    one->is_set_up = 0;
    one->state = INSTANTIATED;
    return fmi2OK;
}

/* Place of a variable that has one of two types; -1 with a message where there is none. */
static long place_of(const Instance *one, fmi2ValueReference reference, int type, int other) {
    if (reference >= one->count) {
        report(one, fmi2Error, "no variable has the value reference %u", reference);
        return -1;
    }
    int own = (int)one->rows[3 * (size_t)reference];
    if (own == type || own == other) return (long)reference;
    report(one, fmi2Error, "the variable of value reference %u has another type", reference);
    return -1;
}

static fmi2Status get(Instance *one, const fmi2ValueReference *references, size_t n, int type,
                      int other, double *reals, int *integers) {
    if (one->state == BROKEN) return refuse(one, "to get a value");
    for (size_t i = 0; i < n; i++) {
        long place = place_of(one, references[i], type, other);
        if (place < 0) return fmi2Error;
        if (one->state == INITIALIZING && (size_t)place >= one->given && set_up(one) != fmi2OK)
            return fmi2Error;
        if (reals) reals[i] = one->values[place];
        if (integers) integers[i] = (int)one->values[place];
    }
    return fmi2OK;
}

static fmi2Status set(Instance *one, const fmi2ValueReference *references, size_t n, int type,
                      int other, const double *reals, const int *integers) {
    if (one->state == BROKEN || one->state == TERMINATED) return refuse(one, "to set a value");
    for (size_t i = 0; i < n; i++) {
        long place = place_of(one, references[i], type, other);
        if (place < 0) return fmi2Error;
        double causality = one->rows[3 * place + 1];
        if (causality == AN_OUTPUT)
            return report(one, fmi2Error, "value reference %ld is an output", place);
        if (causality == A_PARAMETER && one->state == STEPPING)
            return report(one, fmi2Error, "value reference %ld is a fixed parameter", place);
        one->values[place] = reals ? reals[i] : (double)integers[i];
        if (one->state != STEPPING) one->is_set_up = 0;
    }
    return fmi2OK;
}

EXPORT fmi2Status fmi2GetReal(fmi2Component c, const fmi2ValueReference r[], size_t n,
                              fmi2Real v[]) {
    return get(c, r, n, A_REAL, A_REAL, v, NULL);
}
EXPORT fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                 fmi2Integer v[]) {
    return get(c, r, n, AN_INTEGER, AN_ENUMERATION, NULL, v);
}
EXPORT fmi2Status fmi2GetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                 fmi2Boolean v[]) {
    return get(c, r, n, A_BOOLEAN, A_BOOLEAN, NULL, v);
}
EXPORT fmi2Status fmi2GetString(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                fmi2String v[]) {
    (void)r, (void)v;
    return n ? unsupported(c, "fmi2GetString") : fmi2OK;
}
EXPORT fmi2Status fmi2SetReal(fmi2Component c, const fmi2ValueReference r[], size_t n,
                              const fmi2Real v[]) {
    return set(c, r, n, A_REAL, A_REAL, v, NULL);
}
EXPORT fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                 const fmi2Integer v[]) {
    return set(c, r, n, AN_INTEGER, AN_ENUMERATION, NULL, v);
}
EXPORT fmi2Status fmi2SetBoolean(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                 const fmi2Boolean v[]) {
    return set(c, r, n, A_BOOLEAN, A_BOOLEAN, NULL, v);
}
EXPORT fmi2Status fmi2SetString(fmi2Component c, const fmi2ValueReference r[], size_t n,
                                const fmi2String v[]) {
    (void)r, (void)v;
    return n ? unsupported(c, "fmi2SetString") : fmi2OK;
}

EXPORT fmi2Status fmi2DoStep(fmi2Component c, fmi2Real time, fmi2Real step, fmi2Boolean final) {
    Instance *one = c;
    (void)final;
    if (one->state != STEPPING) return refuse(one, "fmi2DoStep");
    if (!isfinite(time) || !isfinite(step) || step <= 0.0)
        return report(one, fmi2Error, "a step of %g s from %g s is not possible", step, time);
    return exchange(one, STEP, time, step);
}

EXPORT fmi2Status fmi2CancelStep(fmi2Component c) { return unsupported(c, "fmi2CancelStep"); }

EXPORT fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *s) {
    (void)s;
    return unsupported(c, "fmi2GetFMUstate");
}
EXPORT fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate s) {
    (void)s;
    return unsupported(c, "fmi2SetFMUstate");
}
EXPORT fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *s) {
    (void)s;
    return unsupported(c, "fmi2FreeFMUstate");
}
EXPORT fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate s, size_t *n) {
    (void)s, (void)n;
    return unsupported(c, "fmi2SerializedFMUstateSize");
}
EXPORT fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate s, fmi2Byte b[], size_t n) {
    (void)s, (void)b, (void)n;
    return unsupported(c, "fmi2SerializeFMUstate");
}
EXPORT fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte b[], size_t n,
                                          fmi2FMUstate *s) {
    (void)s, (void)b, (void)n;
    return unsupported(c, "fmi2DeSerializeFMUstate");
}
EXPORT fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference u[],
                                               size_t nu, const fmi2ValueReference k[], size_t nk,
                                               const fmi2Real dk[], fmi2Real du[]) {
    (void)u, (void)nu, (void)k, (void)nk, (void)dk, (void)du;
    return unsupported(c, "fmi2GetDirectionalDerivative");
}
EXPORT fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference r[],
                                              size_t n, const fmi2Integer o[],
                                              const fmi2Real v[]) {
    (void)r, (void)n, (void)o, (void)v;
    return unsupported(c, "fmi2SetRealInputDerivatives");
}
EXPORT fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference r[],
                                               size_t n, const fmi2Integer o[], fmi2Real v[]) {
    (void)r, (void)n, (void)o, (void)v;
    return unsupported(c, "fmi2GetRealOutputDerivatives");
}
EXPORT fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind k, fmi2Status *v) {
    (void)k, (void)v;
    return unsupported(c, "fmi2GetStatus");
}
EXPORT fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind k, fmi2Real *v) {
    (void)k, (void)v;
    return unsupported(c, "fmi2GetRealStatus");
}
EXPORT fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind k, fmi2Integer *v) {
    (void)k, (void)v;
    return unsupported(c, "fmi2GetIntegerStatus");
}
EXPORT fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind k, fmi2Boolean *v) {
    (void)k, (void)v;
    return unsupported(c, "fmi2GetBooleanStatus");
}
EXPORT fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind k, fmi2String *v) {
    (void)k, (void)v;
    return unsupported(c, "fmi2GetStringStatus");
}
