/* Loads the functions of a shared library, on POSIX and on Windows. */
#ifndef NATIVE_LOAD_H
#define NATIVE_LOAD_H

#include <stdio.h>
#include <string.h>

#ifdef _WIN32
#define WIN32_LEAN_AND_MEAN
#include <windows.h>
typedef FARPROC Address;
#define OPEN(path) ((void *)LoadLibraryA(path))
#define FIND(library, name) GetProcAddress((HMODULE)(library), name)
#define CLOSE(library) FreeLibrary((HMODULE)(library))
#else
#include <dlfcn.h>
typedef void *Address;
#define OPEN(path) dlopen(path, RTLD_NOW | RTLD_LOCAL)
#define FIND(library, name) dlsym(library, name)
#define CLOSE(library) dlclose(library)
#endif

/* The name of a function, and where its address goes. */
typedef struct {
    const char *name;
    void *function;
} Function;

/* Return the library, NULL if it or one of the functions is missing. A cast of an address would not be strict C. */
static void *load(const char *path, const Function functions[], size_t count) {
    void *library = OPEN(path);
    if (library == NULL) fprintf(stderr, "%s cannot be loaded\n", path);
    for (size_t i = 0; library != NULL && i < count; i++) {
        const Address address = FIND(library, functions[i].name);
        memcpy(functions[i].function, &address, sizeof address);
        if (address != NULL) continue;
        fprintf(stderr, "%s is missing\n", functions[i].name);
        CLOSE(library);
        library = NULL;
    }
    return library;
}

#endif
