/* What a hostile FMU does: HOSTILE="WHAT WHERE AT" in the environment says what, in which function
 * and at which of its calls. PLACE is a file to make. */
#define _GNU_SOURCE
#include <errno.h>
#include <fenv.h>
#include <fcntl.h>
#include <linux/fs.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/ioctl.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/time.h>
#include <sys/xattr.h>
#include <unistd.h>

static int dig(volatile char *above) {
    volatile char here[4096];
    here[0] = above[0];
    return dig(here) + here[1];
}

static void spin(void) {
    for (;;) {}
}

static void wait_for_ever(void) {
    for (;;) pause();
}

static void crash(void) { *(volatile int *)0 = 1; }

static void overflow(void) {
    char top[1] = {0};
    dig(top);
}

static void leave(void) { _exit(0); }

static void end(void) { exit(0); }

static void eat(void) {
    for (;;) memset(malloc(64 << 20), 1, 64 << 20);
}

static void ask(void) { memset(malloc((size_t)1 << 40), 1, 4096); }

static void flood(void) {
    static char block[1 << 20];
    FILE *file = tmpfile();
    for (;;) fwrite(block, sizeof block, 1, file);
}

/* Writes to all that is open, as a debugger left in might. */
static void scribble(void) {
    static const char junk[] = "\0\0{\"call\": \"end\"}\n{\"status\": 0, \"refused\": \"\"}\n";
    for (int file = 0; file < 1024; file++) write(file, junk, sizeof junk);
}

static void scribble_and_leave(void) {
    scribble();
    _exit(0);
}

static void spin_at_exit(void) { atexit(spin); }

static void hang_at_exit(void) { atexit(wait_for_ever); }

static void split(void) {
    if (fork() != 0) _exit(0);
}

static void go(void) { chdir("/"); }

static void say_and_hide(void) {
    puts("{\"a\": \"model\"}"), fflush(stdout);
    umask(0777);
}

/* A gigabyte, without which it refuses its work. */
static int refused;

static void beg(void) {
    char *const block = malloc((size_t)1 << 30);
    refused = block == NULL;
    for (size_t k = 0; block != NULL && k < (size_t)1 << 30; k += 4096) block[k] = 1;
}

static void refuse(void) { refused = 1; }

static void twice(void) { fork(); }

static void close_streams(void) {
    for (int file = 0; file < 3; file++) close(file);
}

static void close_files(void) {
    for (int file = 3; file < 1024; file++) close(file);
}

static void kill_itself(void) { raise(SIGKILL); }

/* As protection against copies does. */
static void have_traced(void) { ptrace(PTRACE_TRACEME, 0, NULL, NULL); }

static void be_stopped(void) {
    have_traced();
    raise(SIGUSR1);
}

static void round_up(void) { fesetround(FE_UPWARD); }

static void stay_behind(void) {
    if (fork() == 0) {
        setsid();
        wait_for_ever();
    }
    exit(0);
}

/* What --isolated keeps from happening. */
static void touch(void) {
    const int file = open(getenv("PLACE"), O_CREAT | O_WRONLY, 0600);
    const int net = socket(AF_INET, SOCK_DGRAM, 0);
    fprintf(stderr, "file %s, network %s\n", file < 0 ? "refused" : "open",
            net < 0 ? "refused" : "open");
}

/* A call that isolation refuses says so; DEED is one that was not. */
static void meddle(void) {
    const char *const place = getenv("PLACE");
    const struct timeval times[2] = {{1, 0}, {1, 0}};
    const struct rlimit limit = {1 << 20, 1 << 20};
    const int file = open(place, O_RDONLY);
    const int flags = FS_NODUMP_FL;
    const struct { const char *name; int done; } deeds[] = {
        {"chmod", chmod(place, 0777) == 0},
        {"chown", chown(place, getuid(), getgid()) == 0},
        {"utimes", utimes(place, times) == 0},
        {"setxattr", setxattr(place, "user.a", "b", 1, 0) == 0 || errno == ENOTSUP},
        {"setflags", ioctl(file, FS_IOC_SETFLAGS, &flags) == 0 || errno == ENOTTY},
        {"prlimit", prlimit(getppid(), RLIMIT_CORE, &limit, NULL) == 0},
        {"socket", socket(AF_UNIX, SOCK_STREAM, 0) >= 0},
    };
    for (size_t k = 0; k < sizeof deeds / sizeof *deeds; k++)
        fprintf(stderr, "%s %s\n", deeds[k].name, deeds[k].done ? "DEED" : "refused");
}

static const struct {
    const char *name;
    void (*strike)(void);
} attacks[] = {
    {"exit", end},         {"_exit", leave},    {"abort", abort},     {"crash", crash},
    {"overflow", overflow}, {"spin", spin},      {"wait", wait_for_ever}, {"eat", eat},
    {"ask", ask},          {"flood", flood},    {"kill", kill_itself}, {"daemon", stay_behind},
    {"touch", touch},      {"scribble", scribble}, {"scribble_and_leave", scribble_and_leave},
    {"hang_at_exit", hang_at_exit}, {"spin_at_exit", spin_at_exit}, {"split", split}, {"go", go},
    {"say_and_hide", say_and_hide},
    {"twice", twice},      {"close_streams", close_streams}, {"close_files", close_files},
    {"meddle", meddle},    {"beg", beg},          {"refuse", refuse},
    {"traced", have_traced}, {"stopped", be_stopped}, {"round_up", round_up},
};

static int attack(const char *function) {
    static int calls;
    char what[32], where[64];
    int at;
    const char *const plan = getenv("HOSTILE");
    if (plan == NULL || sscanf(plan, "%31s %63s %d", what, where, &at) != 3) return 0;
    if (strcmp(function, where) != 0 || ++calls != at) return 0;
    refused = 0;
    for (size_t k = 0; k < sizeof attacks / sizeof *attacks; k++)
        if (strcmp(what, attacks[k].name) == 0) attacks[k].strike();
    return refused;
}

__attribute__((constructor)) static void load(void) { attack("load"); }
