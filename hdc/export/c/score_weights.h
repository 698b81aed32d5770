/* Scores: each bit has a whole weight q from -7 to 7, as q + 8 in four planes. With
   bits of +1 and -1 the sum of q times bit is 2 (sum of q + 8 over ones - 8 ones) less
   what no frame changes, which is in the bias. */
static inline void ${name}_score(${name}_scratch *s)
{
    int64_t ones = 0;

    for (uint32_t w = 0; w < ${NAME}_WORDS; w++) {
        ones += ${name}_popcount(s->hypervector[w]);
    }
    for (int c = 0; c < ${NAME}_CLASSES; c++) {
        int64_t sum = -8 * ones;
        for (int p = 0; p < 4; p++) {
            int64_t shared = 0;
            for (uint32_t w = 0; w < ${NAME}_WORDS; w++) {
                shared += ${name}_popcount(s->hypervector[w] & ${name}_weights[c][p][w]);
            }
            sum += shared * (1 << p);
        }
        s->scores[c] = 2 * sum * ${name}_scales[c] + ${name}_biases[c];
    }
}
