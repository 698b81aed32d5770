/* Scores: minus the Hamming distances to the prototypes. */
static inline void ${name}_score(${name}_scratch *s)
{
    for (int c = 0; c < ${NAME}_CLASSES; c++) {
        s->scores[c] = -(int64_t)${name}_distance(s->hypervector, ${name}_prototypes[c]);
    }
}
