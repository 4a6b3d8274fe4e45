#include <fenv.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "text.h"

enum { MOST_DIGITS = 17 }; /* with as many, every double reads back */

static bool continues_character(char byte) {
    return ((unsigned char)byte & 0xC0u) == 0x80u;
}

static size_t length_within(const char *text, size_t most) {
    size_t length = strlen(text);
    if (length <= most) return length;
    length = most;
    for (int i = 0; i < 3 && length > 0 && continues_character(text[length]); i++)
        length--;
    return length;
}

static void clear(Text *text) {
    text->text[0] = '\0';
}

static void append_list(Text *text, const char *format, va_list arguments) {
    const size_t used = strlen(text->text);
    const size_t room = sizeof text->text - used;
    const int length = vsnprintf(text->text + used, room, format, arguments);
    if (length < 0 || (size_t)length >= room) text->text[length_within(text->text, sizeof text->text - 2)] = '\0';
}

static void append(Text *text, const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    append_list(text, format, arguments);
    va_end(arguments);
}

static void escape(Text *to, const char *from) {
    size_t length = 0;
    for (; *from != '\0'; from++) {
        const char same[] = {*from, '\0'};
        const char *piece = *from == '%' ? "percent" : *from == '#' ? "##" : same;
        const size_t more = strlen(piece);
        if (length + more >= sizeof to->text) break;
        memcpy(to->text + length, piece, more);
        length += more;
    }
    to->text[length] = '\0';
    if (*from != '\0') to->text[length_within(to->text, length > 0 ? length - 1 : 0)] = '\0';
}

/* The digits of a decimal d.ddd*10^exponent. */
typedef struct {
    bool negative;
    char digits[MOST_DIGITS + 1];
    int count;
    int exponent;
} Decimal;

/* Take apart what printf's %e wrote, with whatever the locale has for a decimal point. */
static Decimal parsed(const char *text) {
    Decimal decimal = {.negative = *text == '-'};
    for (; *text != 'e'; text++) {
        const bool is_digit = '0' <= *text && *text <= '9';
        if (is_digit && decimal.count < MOST_DIGITS) decimal.digits[decimal.count++] = *text;
    }
    decimal.exponent = (int)strtol(text + 1, NULL, 10);
    while (decimal.count > 1 && decimal.digits[decimal.count - 1] == '0')
        decimal.count--;
    return decimal;
}

/* Write a decimal: by places for exponents from -4 to below `limit`, else with its exponent. */
static Number written(const Decimal *decimal, int limit, bool always_point) {
    Number number = {""};
    char *to = number.text;
    const int exponent = decimal->exponent;
    if (decimal->negative) *to++ = '-';
    if (-5 < exponent && exponent < limit) {
        const int first = exponent > 0 ? exponent : 0;
        int last = exponent - decimal->count + 1;
        if (last > 0) last = 0;
        if (last == 0 && always_point) last = -1;
        for (int place = first; place >= last; place--) {
            const int i = exponent - place;
            if (place == -1) *to++ = '.';
            *to++ = '0';
            if (0 <= i && i < decimal->count) to[-1] = decimal->digits[i];
        }
        return number;
    }
    for (int i = 0; i < decimal->count; i++) {
        if (i == 1) *to++ = '.';
        *to++ = decimal->digits[i];
    }
    snprintf(to, 8, "e%+03d", exponent);
    return number;
}

static Number not_finite(double value) {
    Number number = {"nan"};
    if (isinf(value)) strcpy(number.text, value > 0.0 ? "inf" : "-inf");
    return number;
}

static Number repr(double value) {
    if (!isfinite(value)) return not_finite(value);
    fenv_t host;
    char text[64];
    feholdexcept(&host);
    fesetround(FE_TONEAREST);
    for (int count = 1; count <= MOST_DIGITS; count++) {
        snprintf(text, sizeof text, "%.*e", count - 1, value);
        if (strtod(text, NULL) == value) break;
        /* Below a power of two the doubles are closer: the decimal next above may read back where the nearest does not.
         */
        char *last = strchr(text, 'e') - 1;
        if (*last == '9' || count == MOST_DIGITS) continue;
        ++*last;
        if (strtod(text, NULL) == value) break;
    }
    fesetenv(&host);
    const Decimal decimal = parsed(text);
    return written(&decimal, 16, true);
}

static Number rounded(double value, int digits) {
    if (!isfinite(value)) return not_finite(value);
    fenv_t host;
    char text[64];
    feholdexcept(&host);
    fesetround(FE_TONEAREST);
    snprintf(text, sizeof text, "%.*e", digits - 1, value);
    fesetenv(&host);
    const Decimal decimal = parsed(text);
    return written(&decimal, digits, false);
}
