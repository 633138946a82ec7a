/* A master without Python: loads an FMU's library, steps it, prints one real output a step.

   master LIBRARY GUID RESOURCES REFERENCE STEPS STEP_S */
#include <dlfcn.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>

typedef void *Component;
typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *allocate, *release, *finished, *environment;
} Callbacks;

static void say(void *environment, const char *name, int status, const char *category,
                const char *format, ...) {
    va_list rest;
    (void)environment, (void)status, (void)category;
    va_start(rest, format);
    fprintf(stderr, "%s: ", name);
    vfprintf(stderr, format, rest); /* as masters in C do: the message is a format */
    fputc('\n', stderr);
    va_end(rest);
}

static void *library;

static void *find(const char *name) {
    void *found = dlsym(library, name);
    if (!found) {
        fprintf(stderr, "no function %s\n", name);
        exit(3);
    }
    return found;
}

int main(int count, char **words) {
    if (count != 7) return 2;
    library = dlopen(words[1], RTLD_NOW);
    if (!library) {
        fprintf(stderr, "%s\n", dlerror());
        return 3;
    }
    Component (*instantiate)(const char *, int, const char *, const char *, const void *, int, int);
    int (*experiment)(Component, int, double, double, int, double);
    int (*enter)(Component), (*leave)(Component), (*terminate)(Component);
    int (*get)(Component, const unsigned *, size_t, double *);
    int (*step)(Component, double, double, int);
    void (*release)(Component);
    *(void **)&instantiate = find("fmi2Instantiate");
    *(void **)&experiment = find("fmi2SetupExperiment");
    *(void **)&enter = find("fmi2EnterInitializationMode");
    *(void **)&leave = find("fmi2ExitInitializationMode");
    *(void **)&get = find("fmi2GetReal");
    *(void **)&step = find("fmi2DoStep");
    *(void **)&terminate = find("fmi2Terminate");
    *(void **)&release = find("fmi2FreeInstance");
    Callbacks callbacks = {say, NULL, NULL, NULL, NULL};
    Component one = instantiate("100 %s", 1, words[2], words[3], &callbacks, 0, 0);
    if (!one) return 4;
    if (experiment(one, 0, 0.0, 0.0, 0, 0.0) || enter(one) || leave(one)) return 5;
    unsigned reference = (unsigned)atoi(words[4]);
    double length = atof(words[6]), value = 0.0;
    for (int n = 0; n < atoi(words[5]); n++) {
        if (step(one, n * length, length, 1) || get(one, &reference, 1, &value)) return 6;
        printf("%.17g\n", value);
    }
    if (terminate(one)) return 7;
    release(one);
    return 0;
}
