/*
 * Simulates a system that starts few threads. Preloaded into a process, it lets the process start VG_TEST_THREADS
 * threads in total, and refuses further ones as Linux does at its limit.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *argument) {
    static int started;
    int (*create)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
    const char *allowed = getenv("VG_TEST_THREADS");
    void *address = dlsym(RTLD_NEXT, "pthread_create");
    if (__sync_fetch_and_add(&started, 1) >= (allowed != NULL ? atoi(allowed) : 0)) {
        return EAGAIN;
    }
    memcpy(&create, &address, sizeof create);
    return create(thread, attributes, run, argument);
}
