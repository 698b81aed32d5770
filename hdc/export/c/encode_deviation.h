/* A quotient, rounded down; the divisor is positive. */
static inline int64_t ${name}_floor(int64_t number, int64_t divisor)
{
    return number / divisor - (number % divisor < 0);
}

/* Sum and deviation of the pixels of a frame, each times their number. */
static inline int64_t ${name}_spread(const ${name}_pixel *frame, int64_t *total)
{
    uint64_t sum = 0, squares = 0, high, low, more, less;
    int64_t deviation;

    for (uint32_t j = 0; j < ${NAME}_PIXELS; j++) {
        sum += frame[j];
        squares += (uint64_t)frame[j] * frame[j];
    }
    low = ${name}_product(${NAME}_PIXELS, squares, &high);
    less = ${name}_product(sum, sum, &more);
    high -= more + (low < less);
    deviation = ${name}_root(high, low - less);
    *total = (int64_t)sum;
    return deviation > 0 ? deviation : 1;
}

/* A pixel in units of the deviation less the reference, in steps of 1/65536. */
static inline int64_t ${name}_difference(
    ${name}_pixel pixel, uint32_t j, int64_t total, int64_t deviation)
{
    int64_t centred = (int64_t)${NAME}_PIXELS * pixel - total;

    return ${name}_floor(centred * 65536, deviation) - ${name}_reference[j];
}

/* The frame's hypervector: a bit for each pixel and threshold. */
static inline void ${name}_encode(${name}_scratch *s, const ${name}_pixel *frame)
{
    int64_t total, deviation, sum = 0, unit;
    uint64_t squares = 0;

    deviation = ${name}_spread(frame, &total);
    for (uint32_t j = 0; j < ${NAME}_PIXELS; j++) {
        int64_t d = ${name}_difference(frame[j], j, total, deviation);
        sum += d;
        squares += (uint64_t)(d * d);
    }
    squares -= ((uint64_t)(sum * sum) + ${NAME}_PIXELS - 1) / ${NAME}_PIXELS;
    unit = ${name}_root(0, squares / ${NAME}_PIXELS);
    for (uint32_t t = 0; t < ${NAME}_THRESHOLDS; t++) {
        s->levels[t] = ${name}_floor(
            ${name}_numerators[t] * unit, ${name}_denominators[t]);
    }
    for (uint32_t w = 0; w < ${NAME}_WORDS; w++) {
        s->hypervector[w] = 0;
    }
    for (uint32_t j = 0; j < ${NAME}_PIXELS; j++) {
        int64_t d = ${name}_difference(frame[j], j, total, deviation);
        for (uint32_t t = 0; t < ${NAME}_THRESHOLDS; t++) {
            uint32_t n = t * ${NAME}_PIXELS + j;
            if (d > s->levels[t]) {
                s->hypervector[n / 64] |= (uint64_t)1 << (n % 64);
            }
        }
    }
}
