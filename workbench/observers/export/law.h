/* What an estimator's law remembers between samples; stands in the place of the runtime's
 * memory.h. */
#ifndef MEMORY_H
#define MEMORY_H

/* Numbers of models, LAW_MODELS, of measured inputs and outputs, LAW_INPUTS and LAW_OUTPUTS, of
 * entries of an estimate, LAW_ROW, of inputs that the law sets and outputs that it reads, LAW_SET and
 * LAW_READ, of rows and columns of its Jacobian, LAW_KNOWNS and LAW_UNKNOWNS. LawModelView, and the
 * structs of settings and memory, LawSettings_ and LawMemory_. */
#include "law_data.h"

/* Models and memory of the law. */
typedef struct {
    LawModelView model[LAW_MODELS];
    LawMemory_ memory;
} Law;

/* Part of an instance's state; all zero at the start. */
typedef struct {
    double step; /* time since the sample before, 0: there was none */
    Law now;
    Law before; /* the last sample, to which one that fails is taken back */
} Memory;

/* How many of the last inputs may be NaN: measured outputs of which a sample is missing. */
enum { MISSABLE_INPUTS = LAW_OUTPUTS };

#endif
