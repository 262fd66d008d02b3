/* What the method that steps a model remembers between steps, besides time and states. Another
 * method has a file of its own in the place of this one. */
#ifndef MEMORY_H
#define MEMORY_H

/* Part of an instance's state; all zero at the start. */
typedef struct {
    double step; /* size of the next step, 0 if not known */
} Memory;

/* How many of the last inputs may be NaN: measured signals of which a sample is missing. */
enum { MISSABLE_INPUTS = 0 };

#endif
