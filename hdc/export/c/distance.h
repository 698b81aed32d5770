/* Hamming distance: in how many bits two hypervectors differ. */
static inline uint32_t ${name}_distance(const uint64_t *a, const uint64_t *b)
{
    uint32_t differing = 0;

    for (uint32_t w = 0; w < ${NAME}_WORDS; w++) {
        differing += ${name}_popcount(a[w] ^ b[w]);
    }
    return differing;
}
