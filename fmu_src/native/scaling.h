/* Products of doubles that neither overflow nor lose digits on the way: for models, which need not use them. */
#ifndef SCALING_H
#define SCALING_H

/* A double as mantissa*2^power. */
typedef struct {
    double mantissa;
    int power;
} Split;

/* The parts of `value`; what is not finite is its own mantissa. */
static inline Split split(double value);

/* The product of `count` factors; infinite or zero only where the result leaves the range of a double. */
static inline double product(const double factors[], int count);

#endif
