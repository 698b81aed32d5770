/* When pixel j = 64 w + b has its turn among equal ones: (b + h(w)) mod 64, where h(w)
   are the six highest of 32 bits of w times 2^32 over the golden ratio. */
static inline uint32_t ${name}_turn(uint32_t j)
{
    return (j + ((j / 64 * (uint32_t)0x9E3779B1) >> 26)) % 64;
}

/* Of `equal` pixels at the threshold, the first `missing` become ones: all that have a
   lower turn than some, and with that turn those with the lowest j. */
static inline void ${name}_split(
    ${name}_scratch *s, const ${name}_pixel *pixels, ${name}_level *level,
    uint32_t missing, uint32_t equal)
{
    level->turns = 64;
    level->room = 0;
    if (missing == equal) {
        return;
    }
    for (int turn = 0; turn < 64; turn++) {
        s->turns[turn] = 0;
    }
    for (uint32_t j = 0; j < ${NAME}_RANKED; j++) {
        if (pixels[j] == level->value) {
            s->turns[${name}_turn(j)]++;
        }
    }
    level->turns = 0;
    while (s->turns[level->turns] <= missing) {
        missing -= s->turns[level->turns];
        level->turns++;
    }
    level->room = missing;
}

/* Whether pixel j becomes a one; asked for one pixel after the other. */
static inline int ${name}_is_one(${name}_level *level, uint32_t pixel, uint32_t j)
{
    uint32_t turn;

    if (pixel != level->value) {
        return pixel > level->value;
    }
    turn = ${name}_turn(j);
    if (turn == level->turns && level->room > 0) {
        level->room--;
        return 1;
    }
    return turn < level->turns;
}
