/* Dense linear algebra by LAPACK and BLAS, to whose functions the caller gives pointers. Matrices
   are stored column by column, and only their upper triangle is used: A = U' U. */

typedef struct {
  void (*potrf)(char *, int *, double *, int *, int *);
  void (*trsv)(char *, char *, char *, int *, const double *, int *, double *, int *);
  void (*gemm)(char *, char *, int *, int *, int *, double *, const double *, int *, const double *,
               int *, double *, double *, int *);
} blas;

/* Replace the matrix (size, size) by U; nonzero if it is not positive definite. */
static int cholesky(const blas *library, double *a, int size) {
  char upper = 'U';
  int info;
  library->potrf(&upper, &size, a, &size, &info);
  return info;
}

/* b := U'^-1 b, or U^-1 b. */
static void solve_triangular(const blas *library, int transpose, const double *u, int size,
                             double *b) {
  char upper = 'U', operation = transpose ? 'T' : 'N', diagonal = 'N';
  int one = 1;
  library->trsv(&upper, &operation, &diagonal, &size, u, &size, b, &one);
}

/* c (rows, columns) := keep * c + factor * a (rows, inner) b (inner, columns); keep is 0 or 1, and
   the columns of a are `stride` apart. */
static void add_product(const blas *library, int rows, int columns, int inner, double factor,
                        const double *a, int stride, const double *b, double keep, double *c) {
  char plain = 'N';
  library->gemm(&plain, &plain, &rows, &columns, &inner, &factor, a, &stride, b, &inner, &keep, c,
                &rows);
}
