/* ${file}: does ${header} answer as Python does?
 *
 * Made by hdc export. It makes $n frames by a formula, and compares hypervector, scores
 * and class with those of the model in Python. The program ends with 0 if all agree,
 * else with the number of the first frame that differs, counted from 1:
 *
 *     cc -std=c99 -o ${name}_test ${file} && ./${name}_test
 *
 * Without a main of its own, for a board: -D${NAME}_NO_MAIN, and call ${name}_test().
 */
#include "${header}"

#define ${NAME}_TESTS $n

static const uint64_t ${name}_test_digests[${NAME}_TESTS] = {
$digests
};

static const int64_t ${name}_test_scores[${NAME}_TESTS][${NAME}_CLASSES] = {
$scores
};

static const int ${name}_test_classes[${NAME}_TESTS] = {
$labels
};
$known
static ${name}_pixel ${name}_test_frame[${NAME}_PIXELS];
static ${name}_scratch ${name}_test_scratch;

/* Frame k: noise, few grey levels, two grey levels or a single one, in turn. */
static void ${name}_test_fill(uint32_t k)
{
    for (uint32_t j = 0; j < ${NAME}_PIXELS; j++) {
        uint32_t x = j * (uint32_t)0x9E3779B1 + k * (uint32_t)0x85EBCA6B;
        x ^= x >> 16;
        x *= (uint32_t)0x7FEB352D;
        x ^= x >> 15;
        x *= (uint32_t)0x846CA68B;
        x ^= x >> 16;
        if (k % 4 == 0) {
            x >>= 32 - $bits;
        } else if (k % 4 == 1) {
            x = 100 + x % 5;
        } else if (k % 4 == 2) {
            x = x % 8 < 1 + k / 4 % 7 ? 150 : 50;
        } else {
            x = k;
        }
        ${name}_test_frame[j] = (${name}_pixel)x;
    }
}

/* FNV-1a over the words of the hypervector. */
static uint64_t ${name}_test_digest(const uint64_t *words)
{
    uint64_t digest = 0xCBF29CE484222325;

    for (uint32_t w = 0; w < ${NAME}_WORDS; w++) {
        digest = (digest ^ words[w]) * 0x00000100000001B3;
    }
    return digest;
}

/* 0, or the number of the first frame, from 1, on which C and Python differ. */
int ${name}_test(void);

int ${name}_test(void)
{
    for (int k = 0; k < ${NAME}_TESTS; k++) {
        ${name}_scratch *s = &${name}_test_scratch;
        int found;

        ${name}_test_fill((uint32_t)k);
        found = ${name}_predict(s, ${name}_test_frame);
        if (${name}_test_digest(s->hypervector) != ${name}_test_digests[k]) {
            return k + 1;
        }
        for (int c = 0; c < ${NAME}_CLASSES; c++) {
            if (s->scores[c] != ${name}_test_scores[k][c]) {
                return k + 1;
            }
        }
        if (found != ${name}_test_classes[k]) {
            return k + 1;
        }
$compare_known    }
    return 0;
}

#ifndef ${NAME}_NO_MAIN
int main(void)
{
    return ${name}_test();
}
#endif
