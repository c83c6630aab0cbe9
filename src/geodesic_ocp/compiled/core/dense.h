/* Dense linear algebra by LAPACK and BLAS, to whose functions the caller gives pointers. Matrices
   are stored column by column, and only their upper triangle is used: A = U' U. */

typedef struct {
  void (*potrf)(char *, int *, double *, int *, int *);
  void (*trsv)(char *, char *, char *, int *, const double *, int *, double *, int *);
  void (*gemm)(char *, char *, int *, int *, int *, double *, const double *, int *, const double *,
               int *, double *, double *, int *);
  void (*pbtrf)(char *, int *, int *, double *, int *, int *);
  void (*pbtrs)(char *, int *, int *, int *, double *, int *, double *, int *, int *);
} blas;

/* b := U'^-1 b, or U^-1 b, for U (size, size) with columns `stride` apart. */
static void solve_triangular(const blas *library, int transpose, const double *u, int size,
                             int stride, double *b) {
  char upper = 'U', operation = transpose ? 'T' : 'N', diagonal = 'N';
  int one = 1;
  library->trsv(&upper, &operation, &diagonal, &size, u, &stride, b, &one);
}

#ifdef LANES
/* BLAS is as good for large matrices, and their copies do not fit on the stack. */
#define LARGEST_IN_LANES 256
#define SIX(do) do(0) do(1) do(2) do(3) do(4) do(5)

/* As LAPACK's potrf: six rows of U at once, which are contiguous in `u`. */
static int factor_in_lanes(int size, double *a, int stride) {
  /* rows are an odd number of vectors apart: others would compete for the same lines of the cache */
  int width = (size + 2 * LANES - 1) / (2 * LANES) * 2, apart = width + 1, length = apart * LANES;
  int i, j, k, row;
  lanes u[(size + 5) * apart];
  double *rows = (double *)u;
  memset(u, 0, sizeof(u));
  for (j = 0; j < size; j++)
    for (i = 0; i <= j; i++) rows[i * length + j] = a[(long)j * stride + i];
  for (i = 0; i < size; i += 6) {
    for (j = i / (2 * LANES) * 2; j < width; j += 2) {
#define LOAD(r) lanes left##r = u[(i + r) * apart + j], right##r = u[(i + r) * apart + j + 1];
#define SUBTRACT(r) left##r -= by[r] * at[0], right##r -= by[r] * at[1];
#define SAVE(r) u[(i + r) * apart + j] = left##r, u[(i + r) * apart + j + 1] = right##r;
      const lanes *at = u + j;
      SIX(LOAD)
      for (k = 0; k < i; k++, at += apart) {
        const double *by = rows + (long)k * length + i;
        SIX(SUBTRACT)
      }
      SIX(SAVE)
    }
    for (row = i; row < i + 6 && row < size; row++) {
      double pivot = rows[row * length + row];
      if (!(pivot > 0)) return row + 1;
      pivot = 1 / sqrt(pivot);
      for (j = row / LANES; j < width; j++) u[row * apart + j] *= pivot;
      for (k = row + 1; k < i + 6; k++) {
        double factor = rows[row * length + k];
        for (j = row / LANES; j < width; j++) u[k * apart + j] -= factor * u[row * apart + j];
      }
    }
  }
  for (j = 0; j < size; j++)
    for (i = 0; i <= j; i++) a[(long)j * stride + i] = rows[i * length + j];
  return 0;
}
#endif

/* Replace the matrix (size, size) by U; nonzero if it is not positive definite.

   It is that of the inner nodes of a path: those of a segment are coupled with each other and, by
   the `shared` variables of the node between them, with the next segment, `width` variables
   further. Segments are eliminated one after the other. */
static int cholesky(const blas *library, double *a, int size, int width, int shared) {
  char upper = 'U';
  int start, stop, rows, info, i, j, k;
  for (start = 0; start < size; start = stop) {
    double *block = a + (long)start * size + start, *next = block;
    stop = start == 0 ? width - shared : start + width;
    if (stop > size) stop = size;
    rows = stop - start;
#ifdef LANES
    if (rows <= LARGEST_IN_LANES) {
      info = factor_in_lanes(rows, block, size);
    } else
#endif
      library->potrf(&upper, &rows, block, &size, &info);
    if (info) return info;
    if (stop == size) break;
    next += (long)rows * size; /* the columns of the node that the next segment shares */
    for (j = 0; j < shared; j++) {
      double *column = next + (long)j * size;
      solve_triangular(library, 1, block, rows, size, column);
      for (i = 0; i <= j; i++) {
        const double *other = next + (long)i * size;
        double sum = 0;
        for (k = 0; k < rows; k++) sum += other[k] * column[k];
        column[rows + i] -= sum;
      }
    }
  }
  return 0;
}

#ifdef LANES
/* c (rows) := keep * c + factor * sum, or a part of them where fewer are left */
static inline void store_rows(lanes sum, int rows, double factor, double keep, double *c) {
  lanes before;
  int l;
  sum *= factor;
  if (rows < LANES) {
    for (l = 0; l < rows; l++) c[l] = sum[l] + (keep ? c[l] : 0);
    return;
  }
  memcpy(&before, c, sizeof(before));
  if (keep) sum += before;
  memcpy(c, &sum, sizeof(sum));
}

/* As `add_product`: two vectors of rows by six columns at once. */
static void add_product_in_lanes(int rows, int columns, int inner, double factor, const double *a,
                                 int stride, const double *b, double keep, double *c) {
#define START(j) const double *b##j = b + (long)(column + j < columns ? column + j : column) * inner;
#define ZERO(j) lanes first##j = zero, second##j = zero;
#define ADD(j) first##j += at[0] * b##j[k], second##j += at[1] * b##j[k];
#define STORE(j)                                                                                   \
  if (column + j < columns) {                                                                      \
    double *to = c + (long)(column + j) * rows + row;                                              \
    store_rows(first##j, rows - row, factor, keep, to);                                            \
    if (rows - row > LANES) store_rows(second##j, rows - row - LANES, factor, keep, to + LANES);   \
  }
  int width = (rows + 2 * LANES - 1) / (2 * LANES) * 2, column, row, k;
  lanes packed[inner * width];
  for (k = 0; k < inner; k++) {
    packed[(k + 1) * width - 2] = packed[(k + 1) * width - 1] = zero;
    memcpy(packed + k * width, a + (long)k * stride, sizeof(double) * rows);
  }
  for (column = 0; column < columns; column += 6) {
    SIX(START)
    for (row = 0; row < rows; row += 2 * LANES) {
      const lanes *at = packed + row / LANES;
      SIX(ZERO)
      for (k = 0; k < inner; k++, at += width) { SIX(ADD) }
      SIX(STORE)
    }
  }
}
#endif

/* c (rows, columns) := keep * c + factor * a (rows, inner) b (inner, columns); keep is 0 or 1, and
   the columns of a are `stride` apart. */
static void add_product(const blas *library, int rows, int columns, int inner, double factor,
                        const double *a, int stride, const double *b, double keep, double *c) {
  char plain = 'N';
#ifdef LANES
  if (rows >= LANES && (long)rows * inner <= LARGEST_IN_LANES * LARGEST_IN_LANES) {
    add_product_in_lanes(rows, columns, inner, factor, a, stride, b, keep, c);
    return;
  }
#endif
  library->gemm(&plain, &plain, &rows, &columns, &inner, &factor, a, &stride, b, &inner, &keep, c,
                &rows);
}
