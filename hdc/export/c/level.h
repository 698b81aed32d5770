/* One threshold of a frame. */
typedef struct {
$level
} ${name}_level;
