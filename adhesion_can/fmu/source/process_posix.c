/* POSIX: one socket is both input and output of the process. Unlike a pipe, it can be written to
   without a signal when the process has ended. */
#ifndef _WIN32
#ifdef __linux__
#define _GNU_SOURCE
#else
#define _DARWIN_C_SOURCE
#endif
#include "process.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#ifndef MSG_NOSIGNAL
#define MSG_NOSIGNAL 0 /* macOS has an option of the socket instead */
#endif

#ifdef __APPLE__
#include <crt_externs.h>
#define environ (*_NSGetEnviron()) /* a library of macOS has no environ */
#else
extern char **environ;
#endif

const char *const default_python = "python3";

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int make_pair(int ends[2]) {
#ifdef SOCK_CLOEXEC
    return socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends);
#else
    if (socketpair(AF_UNIX, SOCK_STREAM, 0, ends)) return -1;
    fcntl(ends[0], F_SETFD, FD_CLOEXEC);
    fcntl(ends[1], F_SETFD, FD_CLOEXEC);
    int on = 1;
    return setsockopt(ends[0], SOL_SOCKET, SO_NOSIGPIPE, &on, sizeof on);
#endif
}

int process_start(Process *process, const char *python, const char *resources, char *why) {
    int ends[2];
    if (make_pair(ends)) {
        snprintf(why, REASON, "no socket: %s", strerror(errno));
        return -1;
    }
    char *words[] = {(char *)python, "-P", "-m", "adhesion_can.fmu.child", (char *)resources, NULL};
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 0);
    posix_spawn_file_actions_adddup2(&actions, ends[1], 1);
    /* Signals that the host has blocked or ignores would stay so in the process. */
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    sigset_t none, usual;
    sigemptyset(&none);
    sigemptyset(&usual);
    sigaddset(&usual, SIGTERM);
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &usual);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    int failed = posix_spawnp(&process->pid, python, &actions, &attributes, words, environ);
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    close(ends[1]);
    if (failed) {
        close(ends[0]);
        snprintf(why, REASON, "'%s' cannot be started: %s", python, strerror(failed));
        return -1;
    }
    process->socket = ends[0];
    process->running = 1;
    return 0;
}

/* Wait until the socket is ready for events. 0, or -1 or LATE with the reason. */
static int wait_for(Process *process, short events, double until, char *why) {
    for (;;) {
        struct pollfd wanted = {process->socket, events, 0};
        double left = until - now();
        int ready = poll(&wanted, 1, left > 0 ? (int)(1e3 * left) + 1 : 0);
        if (ready > 0) return 0;
        if (ready == 0 && left <= 0) {
            snprintf(why, REASON, "%s", TOO_LATE);
            return LATE;
        }
        if (ready < 0 && errno != EINTR) {
            snprintf(why, REASON, "the Python process cannot be waited for: %s", strerror(errno));
            return -1;
        }
    }
}

/* Say how the process has ended. */
static void say_end(Process *process, char *why) {
    int status = 0;
    pid_t ended = 0;
    for (int tries = 0; tries < 200 && ended == 0; tries++) {
        ended = waitpid(process->pid, &status, WNOHANG);
        struct timespec pause = {0, 5000000};
        if (ended == 0) nanosleep(&pause, NULL);
    }
    if (ended == process->pid) process->pid = 0;
    if (ended > 0 && WIFSIGNALED(status))
        snprintf(why, REASON, "the Python process was ended by signal %d", WTERMSIG(status));
    else if (ended > 0)
        snprintf(why, REASON, "the Python process ended with status %d", WEXITSTATUS(status));
    else
        snprintf(why, REASON, "the Python process has ended");
}

int process_send(Process *process, const void *bytes, size_t size, double seconds, char *why) {
    const char *place = bytes;
    double until = now() + seconds;
    while (size) {
        int failed = wait_for(process, POLLOUT, until, why);
        if (failed) return failed;
        ssize_t sent = send(process->socket, place, size, MSG_NOSIGNAL | MSG_DONTWAIT);
        if (sent < 0 && errno != EAGAIN && errno != EINTR) {
            say_end(process, why);
            return -1;
        }
        if (sent > 0) place += sent, size -= (size_t)sent;
    }
    return 0;
}

int process_receive(Process *process, void *bytes, size_t size, double seconds, char *why) {
    char *place = bytes;
    double until = now() + seconds;
    while (size) {
        ssize_t got = recv(process->socket, place, size, MSG_DONTWAIT);
        if (got == 0 || (got < 0 && errno != EAGAIN && errno != EINTR)) {
            say_end(process, why);
            return -1;
        }
        if (got > 0) place += got, size -= (size_t)got;
        int failed = size ? wait_for(process, POLLIN, until, why) : 0;
        if (failed) return failed;
    }
    return 0;
}

void process_end(Process *process) {
    if (!process->running) return;
    process->running = 0;
    close(process->socket);
    for (int tries = 0; process->pid && tries < 400; tries++) {
        if (waitpid(process->pid, NULL, WNOHANG)) return; /* ended, or the host has taken it */
        struct timespec pause = {0, 5000000};
        nanosleep(&pause, NULL);
    }
    if (process->pid) {
        kill(process->pid, SIGKILL);
        waitpid(process->pid, NULL, 0);
    }
}

int file_exists(const char *path) { return access(path, R_OK) == 0; }

int read_line(const char *path, char *line, size_t room) {
    FILE *file = fopen(path, "r");
    if (!file) return -1;
    char *got = fgets(line, (int)room, file);
    fclose(file);
    if (!got) return -1;
    line[strcspn(line, "\r\n")] = 0;
    return 0;
}
#endif
