/* Makes the calls of conduct.json in a FMU's shared library and holds its answers against those of the table.
 *
 *     native_conduct LIBRARY GUID conduct.json
 *
 * Prints every call with a wrong answer and how many calls there were; exit status 1 if any is wrong. The table is a
 * sequence of objects without objects in them, "name" for a new case and "call" for a call, and is read as such. */

#include <ctype.h>
#include <dlfcn.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"

enum { MOST_TEXT = 1024 };

static const char *const STATUSES[] = {"OK", "Warning", "Discard", "Error", "Fatal"};

/* The functions of the library. */
static fmi2InstantiateTYPE *instantiate;
static fmi2FreeInstanceTYPE *free_instance;
static fmi2SetupExperimentTYPE *set_up;
static fmi2EnterInitializationModeTYPE *enter;
static fmi2ExitInitializationModeTYPE *leave;
static fmi2TerminateTYPE *terminate;
static fmi2ResetTYPE *reset;
static fmi2GetRealTYPE *get_real;
static fmi2GetIntegerTYPE *get_integer;
static fmi2SetRealTYPE *set_real;
static fmi2SetIntegerTYPE *set_integer;
static fmi2DoStepTYPE *do_step;

static const struct {
    const char *name;
    void *function;
} FUNCTIONS[] = {
    {"fmi2Instantiate", &instantiate},
    {"fmi2FreeInstance", &free_instance},
    {"fmi2SetupExperiment", &set_up},
    {"fmi2EnterInitializationMode", &enter},
    {"fmi2ExitInitializationMode", &leave},
    {"fmi2Terminate", &terminate},
    {"fmi2Reset", &reset},
    {"fmi2GetReal", &get_real},
    {"fmi2GetInteger", &get_integer},
    {"fmi2SetReal", &set_real},
    {"fmi2SetInteger", &set_integer},
    {"fmi2DoStep", &do_step},
};

/* The members of the object that is read; "" where there is none. */
typedef enum { NAME, CALL, REFERENCE, VALUE, START, STOP, TIME, STEP, STATUS, MESSAGE, INSTANCE_NAME, FIELDS } Field;

static const char *const FIELD_NAMES[] = {"name", "call", "reference", "value",   "start",        "stop",
                                          "time", "step", "status",    "message", "instance_name"};
static char fields[FIELDS][MOST_TEXT];

static char logged[MOST_TEXT]; /* by the last call */
static fmi2Component c;
static const char *guid;
static int calls, wrong;

static void logger(fmi2ComponentEnvironment environment, fmi2String name, fmi2Status status, fmi2String category,
                   fmi2String message, ...) {
    va_list arguments;
    (void)environment, (void)name, (void)status, (void)category;
    va_start(arguments, message);
    vsnprintf(logged, sizeof logged, message, arguments);
    va_end(arguments);
}

static const fmi2CallbackFunctions CALLBACKS = {logger, calloc, free, NULL, NULL};

/* A number of the table, which may be a string: "nan", "inf". */
static double number(Field field) {
    return strtod(fields[field], NULL);
}

static bool is_call(const char *name) {
    return strcmp(fields[CALL], name) == 0;
}

/* Make the call; what it gets is in `got`. */
static fmi2Status answer(double *got) {
    const fmi2ValueReference vr = (fmi2ValueReference)strtoul(fields[REFERENCE], NULL, 10);
    const fmi2Real real = number(VALUE);
    fmi2Integer integer = 0;
    if (is_call("fmi2GetReal")) return get_real(c, &vr, 1, got);
    if (is_call("fmi2GetInteger")) {
        const fmi2Status status = get_integer(c, &vr, 1, &integer);
        *got = integer;
        return status;
    }
    if (is_call("fmi2SetReal")) return set_real(c, &vr, 1, &real);
    if (is_call("fmi2SetInteger")) {
        integer = (fmi2Integer)real;
        return set_integer(c, &vr, 1, &integer);
    }
    if (is_call("fmi2SetupExperiment"))
        return set_up(c, fmi2False, 0.0, number(START), *fields[STOP] != '\0', number(STOP));
    if (is_call("fmi2EnterInitializationMode")) return enter(c);
    if (is_call("fmi2ExitInitializationMode")) return leave(c);
    if (is_call("fmi2DoStep")) return do_step(c, number(TIME), number(STEP), fmi2True);
    if (is_call("fmi2Terminate")) return terminate(c);
    if (is_call("fmi2Reset")) return reset(c);
    return fmi2Fatal; /* a call that this program does not know is a wrong answer */
}

/* Make the call that has been read, and compare. */
static void judge(void) {
    static char name[MOST_TEXT];
    double got = 0.0;
    if (*fields[NAME] != '\0') {
        strcpy(name, fields[NAME]);
        if (c != NULL) free_instance(c);
        c = instantiate(fields[INSTANCE_NAME], fmi2CoSimulation, guid, "", &CALLBACKS, fmi2False, fmi2True);
    }
    *logged = '\0';
    const fmi2Status status = c == NULL ? fmi2Fatal : answer(&got);
    const bool gets = strncmp(fields[CALL], "fmi2Get", 7) == 0 && status == fmi2OK;
    calls++;
    if (strcmp(STATUSES[status], fields[STATUS]) == 0 && strcmp(logged, fields[MESSAGE]) == 0 &&
        !(gets && got != number(VALUE)))
        return;
    wrong++;
    printf("%s: %s: %s, \"%s\", %.17g\n", name, fields[CALL], STATUSES[status], logged, got);
}

/* Read a string after its first quote, or a number or a word from its first character on. */
static void read_text(FILE *file, int first, char text[MOST_TEXT]) {
    size_t n = 0;
    int character = first == '"' ? getc(file) : first;
    while (character != EOF && (first == '"' ? character != '"' : isalnum(character) || strchr("+-.", character))) {
        if (character == '\\') character = getc(file);
        if (n < MOST_TEXT - 1) text[n++] = (char)character;
        character = getc(file);
    }
    if (first != '"') ungetc(character, file);
    text[n] = '\0';
}

static void clear_call(void) {
    for (int field = NAME; field < INSTANCE_NAME; field++)
        *fields[field] = '\0';
}

/* Go through the table: a text is a key if a colon follows. */
static void walk(FILE *file) {
    static char key[MOST_TEXT], text[MOST_TEXT];
    int character;
    while ((character = getc(file)) != EOF) {
        if (character == '}') {
            if (*fields[CALL] != '\0') {
                judge();
                clear_call();
            }
        } else if (character == ':') {
            strcpy(key, text);
        } else if (character == '"' || character == '-' || isalnum(character)) {
            read_text(file, character, text);
            for (int field = 0; field < FIELDS; field++)
                if (strcmp(key, FIELD_NAMES[field]) == 0) strcpy(fields[field], text);
        } else if (character == ',' || character == '{') {
            *key = '\0';
        }
    }
}

int main(int argc, char *argv[]) {
    if (argc != 4) return 1;
    void *library = dlopen(argv[1], RTLD_NOW | RTLD_LOCAL);
    FILE *table = fopen(argv[3], "r");
    if (library == NULL || table == NULL) return 1;
    guid = argv[2];
    for (size_t i = 0; i < sizeof FUNCTIONS / sizeof *FUNCTIONS; i++) {
        void *address = dlsym(library, FUNCTIONS[i].name);
        if (address == NULL) return 1;
        memcpy(FUNCTIONS[i].function, &address, sizeof address);
    }
    walk(table);
    fclose(table);
    if (c != NULL) free_instance(c);
    dlclose(library);
    printf("calls %d, wrong %d\n", calls, wrong);
    return calls == 0 || wrong != 0;
}
