/* Steps of symplectic Euler of a cubic lattice: what C can do, to measure ours by.

   Compile with -DLANES=4 or 8 for as many numbers at once, and with -DVOLUME=1 for the volume term
   or 0 without. The formulation is not that of msm/grid_forces.py. A block is LANES neighbouring cells along the fastest axis, at aligned places.
   The nine springs of a cell, three edges and six diagonals, are those of its three lowest faces,
   so that springs and volume term share what they read and what they write: the eight corners are
   loaded once and their forces stored once. Forces on the corners one further along the row are
   shifted in registers, the last of them into the next block; every store is aligned, and no load
   waits for a store that it overlaps by half. Corners: bit 0, 1, 2 of their number tells whether
   they are one further along the first, second, third axis. */

#include <immintrin.h>
#include <math.h>
#include <stdint.h>

typedef double V __attribute__((vector_size(8 * LANES)));
typedef double Any __attribute__((vector_size(8 * LANES), aligned(8)));
typedef int64_t Places __attribute__((vector_size(8 * LANES)));

#define INLINE static inline __attribute__((always_inline))
#define SPRINGS 9

typedef struct {
    int64_t places;        /* of the padded box */
    int64_t second, third; /* how far the next node along these axes is */
    int64_t rows, held_blocks, node_rows;
    const int64_t *row;    /* (rows, 2): first place, number of blocks */
    const double *weight;  /* (blocks, SPRINGS + 1, LANES): springs [N/m], kappa V of cells [J] */
    const int64_t *held_start, *held_first, *held_offset;
    const double *held;    /* [N/m] (held_first[held_blocks], LANES) */
    const int64_t *node_row;                    /* (node_rows, 2) */
    const double *kept, *share, *load;          /* (places,), (places,), (3, places) */
    double *u, *v, *force;                      /* (3, places) */
    double spacing, dt;
} Grid;

INLINE V at(const double *a) { return *(const Any *)a; }

INLINE V aligned(const double *a) { return *(const V *)a; }

INLINE void put(double *a, V x) { *(V *)a = x; }

/* 1 / sqrt(q), from the processor's guess by a series in the relative error of its square. Where
   there is no guess in double precision, root and division take less time than a series. */
#if LANES == 8 && defined(__AVX512F__)
#define GUESS(q) (V)_mm512_rsqrt14_pd((__m512d)(q))
#elif LANES == 4 && defined(__AVX512VL__)
#define GUESS(q) (V)_mm256_rsqrt14_pd((__m256d)(q))
#elif LANES != 4 || !defined(__AVX2__)
#error "4 lanes want AVX2 and 8 lanes AVX-512"
#endif

INLINE V inverse_root(V q)
{
#ifdef GUESS
    V y = GUESS(q), r = 1.0 - q * y * y;
    return y + y * (r * (0.5 + r * (0.375 + r * 0.3125)));
#else
    return 1.0 / (V)_mm256_sqrt_pd((__m256d)q);
#endif
}

/* The last lane of one block and all but the last of the next: one place further back. */
INLINE V shifted(V before, V now)
{
#if LANES == 8
    return __builtin_shuffle(before, now, (Places){7, 8, 9, 10, 11, 12, 13, 14});
#else
    return __builtin_shuffle(before, now, (Places){3, 4, 5, 6});
#endif
}

/* A spring from corner a to corner b, which lies x, y, z cells away. */
INLINE void spring(const V u[3][8], V force[3][8], int a, int b, double h, int x, int y, int z, V k)
{
    double length = h * (x * x + y * y + z * z == 2 ? M_SQRT2 : 1.0);
    V dx = u[0][b] - u[0][a], dy = u[1][b] - u[1][a], dz = u[2][b] - u[2][a];
    if (x) dx += x * h;
    if (y) dy += y * h;
    if (z) dz += z * h;
    V pull = k - k * length * inverse_root(dx * dx + dy * dy + dz * dz);
    dx *= pull, dy *= pull, dz *= pull;
    force[0][a] += dx, force[1][a] += dy, force[2][a] += dz;
    force[0][b] -= dx, force[1][b] -= dy, force[2][b] -= dz;
}

INLINE void gradient(const V u[8], double scale, V *x, V *y, V *z)
{
    V low = u[0] + u[1], far = u[2] + u[3], high = u[4] + u[5], across = u[6] + u[7];
    *x = scale * ((u[1] - u[0]) + (u[3] - u[2]) + ((u[5] - u[4]) + (u[7] - u[6])));
    *y = scale * ((far - low) + (across - high));
    *z = scale * ((high - low) + (across - far));
}

INLINE void scatter(V force[8], V x, V y, V z)
{
    V plus = x + y, minus = x - y;
    V c0 = plus + z, c1 = minus - z, c2 = minus + z, c3 = plus - z;
    force[0] += c0, force[1] -= c1, force[2] += c2, force[3] -= c3;
    force[4] += c3, force[5] -= c2, force[6] += c1, force[7] -= c0;
}

/* A pressure on the faces of each cell: kappa (J - 1) cof(F), F of the cell's mean deformation. */
INLINE void volume(const V u[3][8], V force[3][8], double h, V bulk)
{
    V a, b, e, f, g, i, p, q, r;
    double scale = 0.25 / h;
    gradient(u[0], scale, &a, &b, &e);
    gradient(u[1], scale, &f, &g, &i);
    gradient(u[2], scale, &p, &q, &r);
    V around = g + r + g * r - i * q;
    V swelling = a + (a + 1.0) * around;
    a += 1.0, g += 1.0, r += 1.0;
    V x1 = i * p - f * r, x2 = f * q - g * p;
    swelling += b * x1 + e * x2;
    V pressure = bulk * scale * swelling;
    scatter(force[0], pressure * (1.0 + around), pressure * x1, pressure * x2);
    V y0 = e * q - b * r, y1 = a * r - e * p, y2 = b * p - a * q;
    scatter(force[1], pressure * y0, pressure * y1, pressure * y2);
    V z0 = b * i - e * g, z1 = e * f - a * i, z2 = a * g - b * f;
    scatter(force[2], pressure * z0, pressure * z1, pressure * z2);
}

INLINE void block(const Grid *grid, int64_t i, const double *weight, V carry[3][4])
{
    V u[3][8], force[3][8] = {};
    const int64_t ahead[4] = {0, grid->second, grid->third, grid->second + grid->third};
    for (int d = 0; d < 3; d++)
        for (int c = 0; c < 4; c++) {
            u[d][2 * c] = aligned(grid->u + d * grid->places + i + ahead[c]);
            u[d][2 * c + 1] = at(grid->u + d * grid->places + i + ahead[c] + 1);
        }
    double h = grid->spacing;
    spring(u, force, 0, 1, h, 1, 0, 0, aligned(weight));
    spring(u, force, 0, 2, h, 0, 1, 0, aligned(weight + LANES));
    spring(u, force, 0, 4, h, 0, 0, 1, aligned(weight + LANES * 2));
    spring(u, force, 0, 3, h, 1, 1, 0, aligned(weight + LANES * 3));
    spring(u, force, 1, 2, h, -1, 1, 0, aligned(weight + LANES * 4));
    spring(u, force, 0, 5, h, 1, 0, 1, aligned(weight + LANES * 5));
    spring(u, force, 1, 4, h, -1, 0, 1, aligned(weight + LANES * 6));
    spring(u, force, 0, 6, h, 0, 1, 1, aligned(weight + LANES * 7));
    spring(u, force, 2, 4, h, 0, -1, 1, aligned(weight + LANES * 8));
    if (VOLUME) volume(u, force, h, aligned(weight + LANES * SPRINGS));
    for (int d = 0; d < 3; d++)
        for (int c = 0; c < 4; c++) {
            double *to = grid->force + d * grid->places + i + ahead[c];
            put(to, aligned(to) + (force[d][2 * c] + shifted(carry[d][c], force[d][2 * c + 1])));
            carry[d][c] = force[d][2 * c + 1];
        }
}

static void add_cells_and_springs(const Grid *grid)
{
    const double *weight = grid->weight;
    const int64_t ahead[4] = {0, grid->second, grid->third, grid->second + grid->third};
    for (int64_t r = 0; r < grid->rows; r++) {
        V carry[3][4] = {};
        int64_t first = grid->row[2 * r], end = first + LANES * grid->row[2 * r + 1];
        for (int64_t i = first; i < end; i += LANES, weight += LANES * (SPRINGS + 1))
            block(grid, i, weight, carry);
        for (int d = 0; d < 3; d++)
            for (int c = 0; c < 4; c++)
                grid->force[d * grid->places + end + ahead[c]] += carry[d][c][LANES - 1];
    }
}

static void add_foundation(const Grid *grid)
{
    for (int64_t b = 0; b < grid->held_blocks; b++) {
        int64_t i = grid->held_start[b];
        V sum[3] = {};
        for (int64_t n = grid->held_first[b]; n < grid->held_first[b + 1]; n++) {
            V k = aligned(grid->held + LANES * n);
            for (int d = 0; d < 3; d++)
                sum[d] += k * at(grid->u + d * grid->places + i + grid->held_offset[n]);
        }
        for (int d = 0; d < 3; d++) {
            double *to = grid->force + d * grid->places + i;
            put(to, aligned(to) - sum[d]);
        }
    }
}

static void move(const Grid *grid, double factor)
{
    for (int64_t r = 0; r < grid->node_rows; r++) {
        int64_t first = grid->node_row[2 * r], end = first + LANES * grid->node_row[2 * r + 1];
        for (int64_t i = first; i < end; i += LANES) {
            V kept = aligned(grid->kept + i), share = aligned(grid->share + i);
            for (int64_t j = i; j < 3 * grid->places; j += grid->places) {
                V pushed = aligned(grid->force + j) + factor * aligned(grid->load + j);
                V speed = kept * aligned(grid->v + j) + share * pushed;
                put(grid->v + j, speed);
                put(grid->u + j, aligned(grid->u + j) + grid->dt * speed);
                put(grid->force + j, (V){});
            }
        }
    }
}

void add_forces(const Grid *grid)
{
    add_cells_and_springs(grid);
    add_foundation(grid);
}

void steps(const Grid *grid, int64_t count, double factor)
{
    for (int64_t n = 0; n < count; n++) {
        add_forces(grid);
        move(grid, factor);
    }
}
