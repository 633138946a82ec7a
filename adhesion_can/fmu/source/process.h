/* A process with which bytes are exchanged, with a time limit on every exchange. */
#ifndef PROCESS_H
#define PROCESS_H

#include <stddef.h>

#ifdef _WIN32
#include <windows.h>
typedef struct {
    int running;
    HANDLE handle, to, from;
} Process;
#else
#include <sys/types.h>
typedef struct {
    int running;
    pid_t pid;
    int socket;
} Process;
#endif

enum { REASON = 1024 }; /* room for the reason of a failure, bytes */
enum { LATE = -2 };     /* the process did not answer in time, with this reason: */
#define TOO_LATE                                                                               \
    "the Python process does not answer in time: it was stopped, or the machine is overloaded; " \
    "the environment variable ADHESION_CAN_TIMEOUT sets the limit in seconds"

/* Start `python -P -m adhesion_can.fmu.child RESOURCES`. 0, or -1 with the reason. */
int process_start(Process *process, const char *python, const char *resources, char *why);

/* Send or receive all of some bytes within so many seconds. 0, or -1 or LATE with the reason. */
int process_send(Process *process, const void *bytes, size_t size, double seconds, char *why);
int process_receive(Process *process, void *bytes, size_t size, double seconds, char *why);

/* Close its input, on which it ends, and kill it where it does not. */
void process_end(Process *process);

/* Whether there is such a file; names and paths are UTF-8. */
int file_exists(const char *path);

/* First line of a file, without its end. 0, or -1. */
int read_line(const char *path, char *line, size_t room);

/* Python where neither the environment nor the FMU names one. */
extern const char *const default_python;

#endif
