/* What a hostile FMU does: HOSTILE="WHAT WHERE AT" in the environment says what, in which function
 * and at which of its calls. PLACE is a file to make. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
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

static void kill_itself(void) { raise(SIGKILL); }

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

static const struct {
    const char *name;
    void (*strike)(void);
} attacks[] = {
    {"exit", end},         {"_exit", leave},    {"abort", abort},     {"crash", crash},
    {"overflow", overflow}, {"spin", spin},      {"wait", wait_for_ever}, {"eat", eat},
    {"ask", ask},          {"flood", flood},    {"kill", kill_itself}, {"daemon", stay_behind},
    {"touch", touch},
};

static void attack(const char *function) {
    static int calls;
    char what[32], where[64];
    int at;
    const char *const plan = getenv("HOSTILE");
    if (plan == NULL || sscanf(plan, "%31s %63s %d", what, where, &at) != 3) return;
    if (strcmp(function, where) != 0 || ++calls != at) return;
    for (size_t k = 0; k < sizeof attacks / sizeof *attacks; k++)
        if (strcmp(what, attacks[k].name) == 0) attacks[k].strike();
}

__attribute__((constructor)) static void load(void) { attack("load"); }
