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

/* c (rows, columns) := keep * c + factor * a (rows, inner) b (inner, columns); keep is 0 or 1, and
   the columns of a are `stride` apart. */
static void add_product(const blas *library, int rows, int columns, int inner, double factor,
                        const double *a, int stride, const double *b, double keep, double *c) {
  char plain = 'N';
  library->gemm(&plain, &plain, &rows, &columns, &inner, &factor, a, &stride, b, &inner, &keep, c,
                &rows);
}
