$banner
#ifndef ${NAME}_H
#define ${NAME}_H

#include <stdint.h>

/* The casts of C, where C++ would like its own. */
#if defined(__cplusplus) && defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wold-style-cast"
#if !defined(__clang__)
#pragma GCC diagnostic ignored "-Wuseless-cast"
#endif
#endif

$sizes

typedef $pixel ${name}_pixel;

/* What a prediction works with and leaves behind; make one, static. */
typedef struct {
$fields
} ${name}_scratch;

#define ${NAME}_SCRATCH_BYTES sizeof(${name}_scratch)

$tables

/* Encoding ------------------------------------------------------------------------- */

$encoding

/* Classes -------------------------------------------------------------------------- */

$classes

/* The class of a frame, as a place in ${name}_classes; the first of equal scores. */
static inline int ${name}_predict(${name}_scratch *s, const ${name}_pixel *frame)
{
    int best = 0;

    ${name}_encode(s, frame);
    ${name}_score(s);
    for (int c = 1; c < ${NAME}_CLASSES; c++) {
        if (s->scores[c] > s->scores[best]) {
            best = c;
        }
    }
    return best;
}
$after
#if defined(__cplusplus) && defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#endif /* ${NAME}_H */
