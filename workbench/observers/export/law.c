/* An estimator's law, one sample at a time; stands in the place of the integrator of other FMUs.
 *
 * The law itself, law_code.h, is translated from Python. The FMU's inputs are the measured inputs
 * and outputs of the system, its states the entries of the law's estimate. A communication step takes
 * one sample: the inputs that stand at its start; the law advances by the time since the sample
 * before, which is the size of the communication step before. Parameters are those of the gains that
 * the settings have as they are. The first sample is the first that is
 * whole: measured outputs that are NaN are missing, and such that are all zero are inputs that a tool
 * has not connected yet.
 */
#include "integrator.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* plant.h: sizes PLANT_NX, PLANT_NNZ_XU; place among the model's inputs of each that the law knows,
 * plant_input; place in w of each output that it reads, or -1 - number of the state, plant_output;
 * column of the law's Jacobian for each row of the model's, plant_unknown; parameters of each of the
 * law's models, plant_parameter. */
#include "plant_code.h"

enum { LAW_OK, LAW_REFUSED, LAW_SINGULAR };

/* The model ----------------------------------------------------------------------------------- */

/* Each counterpart of a function of workbench/models/native.py refuses what an FMU refuses there. */

static inline int plant_set_inputs(LawModelView *model, int first, int count) {
    for (int k = first; k < first + count; k++) {
        if (!isfinite(model->u[k])) {
            return LAW_REFUSED;
        }
    }
    for (int k = first; k < first + count; k++) {
        model->at_u[plant_input[k]] = model->u[k];
    }
    return LAW_OK;
}

/* The plant has no explicit time, which an export refuses. */
static inline int plant_set_sample(LawModelView *model, const double *u) {
    memcpy(model->u, u, LAW_INPUTS * sizeof *u);
    return plant_set_inputs(model, 0, LAW_INPUTS);
}

static inline int plant_set_point(LawModelView *model, const double *u) {
    return plant_set_sample(model, u);
}

static inline int plant_set_states(LawModelView *model) {
    for (int k = 0; k < PLANT_NX; k++) {
        if (!isfinite(model->x[k])) {
            return LAW_REFUSED;
        }
    }
    memcpy(model->at_x, model->x, PLANT_NX * sizeof *model->x);
    return LAW_OK;
}

static inline int plant_place(LawModelView *model) {
    const int status = plant_set_inputs(model, 0, LAW_SET);
    return status != LAW_OK ? status : plant_set_states(model);
}

static inline int plant_evaluate(LawModelView *model) {
    const double *const p = plant_parameter[model->number];
    int status = plant_derivatives(0.0, model->at_x, model->at_u, p, model->dx);
    for (int k = 0; k < PLANT_NX; k++) {
        status |= !isfinite(model->dx[k]);
    }
    return status != 0 ? LAW_REFUSED : LAW_OK;
}

static inline int plant_read(LawModelView *model) {
    const double *const p = plant_parameter[model->number];
    double w[PLANT_NW + 1];
    int status = plant_algebraics(0.0, model->at_x, model->at_u, p, w);
    for (int k = 0; k < LAW_READ; k++) {
        const int place = plant_output[k];
        model->y[k] = place >= 0 ? w[place] : model->at_x[-1 - place];
        status |= !isfinite(model->y[k]);
    }
    return status != 0 ? LAW_REFUSED : LAW_OK;
}

/* Row `row` of the Jacobian from its nonzeros, those of column `column` of the model's. */
static inline int plant_scatter(LawModelView *model, const double *nonzero, int row, int column, int count) {
    double *const out = model->jacobian + row * LAW_UNKNOWNS;
    int status = LAW_OK;
    for (int k = 0; k < count; k++) {
        const int place = k < PLANT_NX ? 0 : plant_output[k - PLANT_NX];
        out[k] = place < 0 && -1 - place == column ? 1.0 : 0.0;
    }
    for (int n = plant_jacobian_xu_column[column]; n < plant_jacobian_xu_column[column + 1]; n++) {
        const int unknown = plant_unknown[plant_jacobian_xu_row[n]];
        if (unknown < count) {
            out[unknown] = nonzero[n];
            status = isfinite(nonzero[n]) ? status : LAW_REFUSED;
        }
    }
    return status;
}

static inline int plant_differentiate(LawModelView *model, int row, int count) {
    const double *const p = plant_parameter[model->number];
    const int column = row < PLANT_NX ? row : PLANT_NX + plant_input[LAW_INPUTS + row - PLANT_NX];
    double nonzero[PLANT_NNZ_XU + 1];
    if (plant_jacobian_xu(0.0, model->at_x, model->at_u, p, nonzero) != 0) {
        return LAW_REFUSED;
    }
    return plant_scatter(model, nonzero, row, column, count);
}

static inline int plant_linearise(LawModelView *model, int count) {
    const double *const p = plant_parameter[model->number];
    double nonzero[PLANT_NNZ_XU + 1];
    if (plant_jacobian_xu(0.0, model->at_x, model->at_u, p, nonzero) != 0) {
        return LAW_REFUSED;
    }
    for (int row = 0; row < LAW_KNOWNS; row++) {
        const int column =
            row < PLANT_NX ? row : PLANT_NX + plant_input[LAW_INPUTS + row - PLANT_NX];
        if (plant_scatter(model, nonzero, row, column, count) != LAW_OK) {
            return LAW_REFUSED;
        }
    }
    return LAW_OK;
}

/* Python ------------------------------------------------------------------------------------ */

/* An index, from the end where it is negative; ends and length of a slice. */
static inline int python_index(int index, int size) { return index < 0 ? index + size : index; }

static inline int python_end(int end, int size) {
    const int from_start = end < 0 ? end + size : end;
    return from_start < 0 ? 0 : from_start > size ? size : from_start;
}

static inline int python_length(int first, int last) { return last > first ? last - first : 0; }

static inline double python_square(double value) { return value * value; }
static inline int python_square_int(int value) { return value * value; }

/* The first stays where the comparison is false, as with NaN. */
static inline double python_least(double a, double b) { return b < a ? b : a; }
static inline double python_most(double a, double b) { return b > a ? b : a; }
static inline int python_least_int(int a, int b) { return b < a ? b : a; }
static inline int python_most_int(int a, int b) { return b > a ? b : a; }

/* estimator_begin, which gives all that is remembered its value at the first sample, and
 * estimator_step, which takes a sample. */
#include "law_code.h"

/* Samples ------------------------------------------------------------------------------------- */

/* The model's assertions are those of a simulation, which an estimate need not meet on its way. */
int first_violated(double t, const double *x, const double *u, const double *p, double *holds) {
    (void)t, (void)x, (void)u, (void)p, (void)holds;
    return -1;
}

/* Whether an estimate can begin at a sample. */
static int is_first(const double *y) {
    int connected = LAW_OUTPUTS == 0;
    for (int j = 0; j < LAW_OUTPUTS; j++) {
        if (isnan(y[j])) {
            return 0;
        }
        connected |= y[j] != 0.0;
    }
    return connected;
}

Outcome rosenbrock_integrate(Rosenbrock *r, const double *u, const double *p, double tolerance,
                             double end, double *t, double *x, Memory *memory) {
    (void)tolerance;
    if (memory->step > 0.0 || is_first(u + LAW_INPUTS)) {
        double row[LAW_ROW];
        for (int k = 0; k < LAW_ROW; k++) {
            row[k] = NAN;
        }
        if (memory->step == 0.0) {
            estimator_begin(&memory->now, u);
        } else {
            memory->before = memory->now;
        }
        if (estimator_step(&memory->now, memory->step, u, p, row) != LAW_OK) {
            memory->now = memory->before;
            r->bad = REFERENCE_U;
            r->t_bad = *t;
            return OUTCOME_NOT_FINITE;
        }
        memcpy(x, row, sizeof row);
        memory->step = end - *t;
    }
    *t = end;
    return OUTCOME_REACHED;
}
