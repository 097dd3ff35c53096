/* Repeats the calls of a law's trial: for a law that was compiled with sanitizers, which end the process where it does
 * harm. Arguments: the library, a file of gains and then measurements, how many gains there are, and how many numbers of
 * memory. Without arguments it does nothing, which shows that sanitizers work here.
 */
#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef long long smc_entry(const double *, const double *, double *, double *);

const char *__asan_default_options(void);
const char *__asan_default_options(void) { return "detect_leaks=0"; }

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
    double *gains, *memory, *y = numbers(SMC_INPUTS), *out = numbers(2);
    size_t many, size;
    FILE *file;

    if (count < 5) return 0;
    library = dlopen(word[1], RTLD_NOW | RTLD_LOCAL);
    if (!library) return failed(dlerror());
    many = strtoul(word[3], NULL, 10), size = strtoul(word[4], NULL, 10);
    gains = numbers(many), memory = numbers(size);
    file = fopen(word[2], "rb");
    if (!file || fread(gains, sizeof(double), many, file) != many) return failed("no gains");
    if ((found = dlsym(library, "smc_setup"))) {
        memcpy(&setup, &found, sizeof found);
        if (setup()) return failed("smc_setup failed");
    }
    *(int *)dlsym(library, "smc_mujoco_gains") = (int)many;
    *(int *)dlsym(library, "smc_mujoco_memory") = (int)size;
    found = dlsym(library, "smc_mujoco_entry");
    memcpy(&law, &found, sizeof found);
    while (fread(y, sizeof(double), SMC_INPUTS, file) == SMC_INPUTS) {
        if (y[0] == 0.0) memset(memory, 0, size * sizeof(double)); /* a run begins */
        law(y, gains, memory, out);
    }
    return 0;
}
