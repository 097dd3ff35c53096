/* Repeats the calls of a law's trial: for a law that was compiled with sanitizers, which end the process where it does
 * harm. Arguments: the library, a file of gains and then measurements, how many gains there are, and how many numbers of
 * memory. Without arguments it does nothing, which shows that sanitizers work here.
 */
#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef long long smc_entry(const double *, const double *, double *, double *);
/* What joint_law.py stores before the arrays (HEAD), and what `dynamics` is the address of (HANDLE). */
typedef struct { double t, dt, model, dynamics, joints; } head;
typedef struct { double coriolis, jacobian, parameters, unit; } requests;

const char *__asan_default_options(void);
const char *__asan_default_options(void) { return "detect_leaks=0"; }

/* For C(x, v) w and the Jacobian of a law of many joints: all 0. */
static long long nothing(const double *in, const double *own, double *memory, double *out)
{
    (void)in, (void)own, (void)memory, (void)out;
    return 0;
}

/* Numbers on the heap, where a step beyond them is seen. */
static double *numbers(size_t count) { return calloc(count, sizeof(double)); }

static int failed(const char *what)
{
    fprintf(stderr, "%s\n", what);
    return 1;
}

int main(int count, char **word)
{
    void *library, *found;
    int (*setup)(void);
    smc_entry *law;
    double *gains, *memory, *y, *out;
    requests asked = {(double)(intptr_t)nothing, (double)(intptr_t)nothing, 0.0, 1.0};
    size_t many, size, inputs, each, joints;
    FILE *file;

    if (count < 5) return 0;
    library = dlopen(word[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return failed(dlerror());
    joints = (size_t)*(const int *)dlsym(library, "smc_mujoco_joints");
    each = joints ? joints : 1;
    inputs = joints ? sizeof(head) / sizeof(double) + (SMC_VECTORS + 2 + joints) * joints : SMC_INPUTS;
    y = numbers(inputs), out = numbers(2 * each);
    many = each * strtoul(word[3], NULL, 10), size = each * strtoul(word[4], NULL, 10);
    gains = numbers(many), memory = numbers(size);
    file = fopen(word[2], "rb");
    if (!file || fread(gains, sizeof(double), many, file) != many) return failed("no gains");
    if ((found = dlsym(library, "smc_setup"))) {
        memcpy(&setup, &found, sizeof found);
        if (setup()) return failed("smc_setup failed");
    }
    *(int *)dlsym(library, "smc_mujoco_gains") = (int)(many / each);
    *(int *)dlsym(library, "smc_mujoco_memory") = (int)(size / each);
    found = dlsym(library, "smc_mujoco_entry");
    memcpy(&law, &found, sizeof found);
    while (fread(y, sizeof(double), inputs, file) == inputs) {
        if (joints) ((head *)y)->dynamics = (double)(intptr_t)&asked;
        if (((head *)y)->t == 0.0) memset(memory, 0, size * sizeof(double)); /* a run begins */
        law(y, gains, memory, out);
    }
    return 0;
}
