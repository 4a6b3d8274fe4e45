/* Texts of bounded size. Numbers in them read as in Python, whatever the locale, the rounding mode and the
 * floating-point traps of the host are. */
#ifndef TEXT_H
#define TEXT_H

#include <stdarg.h>
#include <stddef.h>

/* 4 KiB: kept in memory of the instance, because a thread may have a stack of 32 KiB. */
typedef struct {
    char text[4096];
} Text;

typedef struct {
    char text[32];
} Number;

/* The length of `text`; if that is beyond `most` bytes, less, to end between two characters of UTF-8. */
static size_t length_within(const char *text, size_t most);

/* Make a text empty. */
static void clear(Text *text);

/* Add to a text; what does not fit is left out, whole characters of UTF-8 at a time. */
static void append(Text *text, const char *format, ...);
static void append_list(Text *text, const char *format, va_list arguments);

/* Write `from` into `to` as importers can use it for a format and for variables: `%` is written "percent", `#` is
 * doubled. */
static void escape(Text *to, const char *from);

/* The shortest decimal that reads back as `value`, written like Python's repr(). */
static Number repr(double value);

/* `value` rounded to `digits` digits, at most 15, written like printf's %g. */
static Number rounded(double value, int digits);

#endif
