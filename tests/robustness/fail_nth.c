/* Fails the n-th call of one kind (open, read, write, rename) that concerns files below one folder, or the n-th allocation of
 * LEAST bytes or more, as SQLite's tests do. "sector": the n-th read, and from then on every read of that byte of that file.
 * Preloaded; quiet until armed by hrg_fault_arm() in a forked child. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <execinfo.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

enum { FILES = 4096, LEAST = 16384 };
static char folder[4096], kind[16];
static long nth, seen, hits;
static int code, armed;
static struct stat bad_file;
static off_t bad_byte;
static char ours[FILES];

/* A crash names the innermost library that is neither this one, nor Python's, nor the C library's: whose code did not stand
 * the failure. */
enum { FRAMES = 64 };
static const char *base_of(const char *path) { const char *slash = strrchr(path, '/'); return slash ? slash + 1 : path; }
static void crashed(int sig) {
    static const char *const carriers[] = {"libpython", "python", "libc.so", "libm.so", "libpthread", "ld-linux", "fail_nth"};
    void *frames[FRAMES];
    const char *whose = "Python";
    armed = 0;
    for (int i = 0, n = backtrace(frames, FRAMES); i < n; i++) {
        Dl_info at;
        int carries = !dladdr(frames[i], &at) || !at.dli_fname;
        for (size_t k = 0; !carries && k < sizeof carriers / sizeof *carriers; k++)
            carries = strncmp(base_of(at.dli_fname), carriers[k], strlen(carriers[k])) == 0;
        if (!carries) { whose = base_of(at.dli_fname); break; }
    }
    dprintf(2, "crashed inside %s\n", whose);
    signal(sig, SIG_DFL);
    raise(sig);
}

void hrg_fault_arm(const char *where, const char *what, int n, int error) {
    void *first[1];
    backtrace(first, 1); /* loads what it needs, which allocates */
    signal(SIGSEGV, crashed), signal(SIGABRT, crashed);
    snprintf(folder, sizeof folder, "%s", where);
    snprintf(kind, sizeof kind, "%s", what);
    nth = n, code = error, seen = hits = 0, armed = 1;
    memset(ours, 0, sizeof ours);
}
void hrg_fault_disarm(void) { armed = 0; }
long hrg_fault_hits(void) { return hits; }
long hrg_fault_seen(void) { return seen; }

static int below(const char *path) {
    char cwd[4096];
    if (!armed || !path) return 0;
    if (path[0] != '/') return getcwd(cwd, sizeof cwd) && strncmp(cwd, folder, strlen(folder)) == 0 && path[0] != '\0' && strncmp(path, ".std", 4) != 0;
    return strncmp(path, folder, strlen(folder)) == 0;
}
static int fails(const char *what) {
    if (strcmp(kind, what) != 0 || ++seen != nth) return 0;
    hits++;
    errno = code;
    return 1;
}
/* A failed read of `n` bytes at `at`: this once, or of a bad sector again. */
static int unread(int fd, size_t n, off_t at) {
    struct stat file;
    if (strcmp(kind, "sector") != 0) return fails("read");
    if (fstat(fd, &file)) return 0;
    if (!hits) {
        if (!fails("sector")) return 0;
        bad_file = file, bad_byte = at;
        return 1;
    }
    if (file.st_ino != bad_file.st_ino || file.st_dev != bad_file.st_dev || at > bad_byte || bad_byte - at >= (off_t)n) return 0;
    errno = code;
    return 1;
}
static int known(int fd) { return armed && fd >= 0 && fd < FILES && ours[fd]; }

#define REAL(type, name, ...) \
    static type (*real)(__VA_ARGS__); \
    if (!real) real = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name)

#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        REAL(int, name, const char *, int, ...); \
        va_list list; va_start(list, flags); mode_t mode = (flags & (O_CREAT | O_TMPFILE)) ? va_arg(list, mode_t) : 0; va_end(list); \
        int mine = below(path); \
        if (mine && fails("open")) return -1; \
        int fd = real(path, flags, mode); \
        if (fd >= 0 && fd < FILES) ours[fd] = (char)mine; \
        return fd; \
    }
OPEN(open)
OPEN(open64)
#define OPENAT(name) \
    int name(int at, const char *path, int flags, ...) { \
        REAL(int, name, int, const char *, int, ...); \
        va_list list; va_start(list, flags); mode_t mode = (flags & (O_CREAT | O_TMPFILE)) ? va_arg(list, mode_t) : 0; va_end(list); \
        int mine = below(path); \
        if (mine && fails("open")) return -1; \
        int fd = real(at, path, flags, mode); \
        if (fd >= 0 && fd < FILES) ours[fd] = (char)mine; \
        return fd; \
    }
OPENAT(openat)
OPENAT(openat64)

ssize_t read(int fd, void *to, size_t n) { REAL(ssize_t, read, int, void *, size_t); return known(fd) && unread(fd, n, lseek(fd, 0, SEEK_CUR)) ? -1 : real(fd, to, n); }
ssize_t pread(int fd, void *to, size_t n, off_t at) { REAL(ssize_t, pread, int, void *, size_t, off_t); return known(fd) && unread(fd, n, at) ? -1 : real(fd, to, n, at); }
ssize_t pread64(int fd, void *to, size_t n, off64_t at) { REAL(ssize_t, pread64, int, void *, size_t, off64_t); return known(fd) && unread(fd, n, at) ? -1 : real(fd, to, n, at); }
ssize_t write(int fd, const void *from, size_t n) { REAL(ssize_t, write, int, const void *, size_t); return known(fd) && fails("write") ? -1 : real(fd, from, n); }
ssize_t pwrite(int fd, const void *from, size_t n, off_t at) { REAL(ssize_t, pwrite, int, const void *, size_t, off_t); return known(fd) && fails("write") ? -1 : real(fd, from, n, at); }
ssize_t pwrite64(int fd, const void *from, size_t n, off64_t at) { REAL(ssize_t, pwrite64, int, const void *, size_t, off64_t); return known(fd) && fails("write") ? -1 : real(fd, from, n, at); }
int ftruncate(int fd, off_t n) { REAL(int, ftruncate, int, off_t); return known(fd) && fails("write") ? -1 : real(fd, n); }
int ftruncate64(int fd, off64_t n) { REAL(int, ftruncate64, int, off64_t); return known(fd) && fails("write") ? -1 : real(fd, n); }
/* The C library's own allocator under the names it keeps for such wrappers. */
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t), *__libc_memalign(size_t, size_t);
static int short_of(size_t n) { return armed && n >= LEAST && fails("alloc"); }
void *malloc(size_t n) { return short_of(n) ? NULL : __libc_malloc(n); }
void *calloc(size_t k, size_t n) { return short_of(k * n) ? NULL : __libc_calloc(k, n); }
void *realloc(void *p, size_t n) { return short_of(n) ? NULL : __libc_realloc(p, n); }
void *memalign(size_t by, size_t n) { return short_of(n) ? NULL : __libc_memalign(by, n); }
void *aligned_alloc(size_t by, size_t n) { return short_of(n) ? NULL : __libc_memalign(by, n); }
int posix_memalign(void **p, size_t by, size_t n) { return !short_of(n) && (*p = __libc_memalign(by, n)) ? 0 : ENOMEM; }

int rename(const char *a, const char *b) { REAL(int, rename, const char *, const char *); return below(b) && fails("rename") ? -1 : real(a, b); }
int link(const char *a, const char *b) { REAL(int, link, const char *, const char *); return below(b) && fails("rename") ? -1 : real(a, b); }
