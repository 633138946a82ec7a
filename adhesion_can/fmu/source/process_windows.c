/* Windows: two pipes. An anonymous pipe has no time limit of its own, so it is looked into. */
#ifdef _WIN32
#include "process.h"

#include <stdio.h>
#include <string.h>

enum { LONGEST = 4096, SPINS = 2000 };
const char *const default_python = "python";

static int wide(const char *text, wchar_t *out, int room) {
    return MultiByteToWideChar(CP_UTF8, 0, text, -1, out, room) > 0 ? 0 : -1;
}

int process_start(Process *process, const char *python, const char *resources, char *why) {
    char line[LONGEST];
    wchar_t words[LONGEST];
    SECURITY_ATTRIBUTES inherit = {sizeof inherit, NULL, TRUE};
    HANDLE input = NULL, output = NULL;
    int length = snprintf(line, sizeof line, "\"%s\" -P -m adhesion_can.fmu.child \"%s\"", python,
                          resources);
    if (length < 0 || length >= LONGEST || wide(line, words, LONGEST)) {
        snprintf(why, REASON, "the path of the FMU is too long");
        return -1;
    }
    if (!CreatePipe(&input, &process->to, &inherit, 1 << 16)) {
        snprintf(why, REASON, "no pipe: error %lu", GetLastError());
        return -1;
    }
    if (!CreatePipe(&process->from, &output, &inherit, 1 << 16)) {
        snprintf(why, REASON, "no pipe: error %lu", GetLastError());
        CloseHandle(input);
        CloseHandle(process->to);
        return -1;
    }
    SetHandleInformation(process->to, HANDLE_FLAG_INHERIT, 0);
    SetHandleInformation(process->from, HANDLE_FLAG_INHERIT, 0);
    STARTUPINFOW start;
    PROCESS_INFORMATION made;
    memset(&start, 0, sizeof start);
    start.cb = sizeof start;
    start.dwFlags = STARTF_USESTDHANDLES;
    start.hStdInput = input;
    start.hStdOutput = output;
    start.hStdError = GetStdHandle(STD_ERROR_HANDLE);
    BOOL started =
        CreateProcessW(NULL, words, NULL, NULL, TRUE, CREATE_NO_WINDOW, NULL, NULL, &start, &made);
    DWORD failed = started ? 0 : GetLastError();
    CloseHandle(input);
    CloseHandle(output);
    if (!started) {
        CloseHandle(process->to);
        CloseHandle(process->from);
        snprintf(why, REASON, "'%s' cannot be started: error %lu", python, failed);
        return -1;
    }
    CloseHandle(made.hThread);
    process->handle = made.hProcess;
    process->running = 1;
    return 0;
}

static void say_end(Process *process, char *why) {
    DWORD status = STILL_ACTIVE;
    WaitForSingleObject(process->handle, 1000);
    GetExitCodeProcess(process->handle, &status);
    snprintf(why, REASON, "the Python process ended with status %lu", status);
}

int process_send(Process *process, const void *bytes, size_t size, double seconds, char *why) {
    /* The pipe is empty, for every request is answered before the next, and has room for one. */
    const char *place = bytes;
    (void)seconds;
    while (size) {
        DWORD sent = 0;
        if (!WriteFile(process->to, place, (DWORD)size, &sent, NULL)) {
            say_end(process, why);
            return -1;
        }
        place += sent, size -= sent;
    }
    return 0;
}

int process_receive(Process *process, void *bytes, size_t size, double seconds, char *why) {
    char *place = bytes;
    ULONGLONG until = GetTickCount64() + (ULONGLONG)(1e3 * seconds);
    for (int looks = 0; size; looks++) {
        DWORD there = 0, got = 0;
        if (!PeekNamedPipe(process->from, NULL, 0, NULL, &there, NULL)) {
            say_end(process, why);
            return -1;
        }
        if (there) {
            DWORD most = there < size ? there : (DWORD)size;
            if (!ReadFile(process->from, place, most, &got, NULL)) {
                say_end(process, why);
                return -1;
            }
            place += got, size -= got;
            continue;
        }
        if (GetTickCount64() > until) {
            snprintf(why, REASON, "%s", TOO_LATE);
            return LATE;
        }
        if (looks < SPINS) SwitchToThread();
        else Sleep(1);
    }
    return 0;
}

void process_end(Process *process) {
    if (!process->running) return;
    process->running = 0;
    CloseHandle(process->to);
    if (WaitForSingleObject(process->handle, 2000) != WAIT_OBJECT_0)
        TerminateProcess(process->handle, 1);
    CloseHandle(process->from);
    CloseHandle(process->handle);
}

int file_exists(const char *path) {
    wchar_t name[LONGEST];
    return !wide(path, name, LONGEST) && GetFileAttributesW(name) != INVALID_FILE_ATTRIBUTES;
}

int read_line(const char *path, char *line, size_t room) {
    wchar_t name[LONGEST];
    FILE *file = wide(path, name, LONGEST) ? NULL : _wfopen(name, L"r");
    if (!file) return -1;
    char *got = fgets(line, (int)room, file);
    fclose(file);
    if (!got) return -1;
    line[strcspn(line, "\r\n")] = 0;
    return 0;
}
#endif
