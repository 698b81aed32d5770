
/* Whether the last frame is as near to a class as its frames were in training: 1, or 0
   for a frame unlike every class. Ask after ${name}_predict. */
static inline int ${name}_known(const ${name}_scratch *s)
{
    for (int c = 0; c < ${NAME}_CLASSES; c++) {
        if (${distance} <= ${name}_thresholds[c]) {
            return 1;
        }
    }
    return 0;
}
