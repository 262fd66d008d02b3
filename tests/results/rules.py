"""What differs from run to run of the same code, and what stands in its place."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from fnmatch import fnmatchcase


@dataclass(frozen=True)
class Rule:
    """Replace what a pattern matches.

    Attributes
    ----------
    files : patterns, as shells have them, of names of files, or "stdout" and "stderr".
    pattern, instead : as `re.sub` takes them.
    reason : why it may differ between runs of the same code.
    """

    files: str
    pattern: str
    instead: str
    reason: str


def applied(rules: Iterable[Rule], name: str, text: str) -> str:
    """Apply the rules for a file to its text, one after the other."""
    for rule in rules:
        if any(fnmatchcase(name, pattern) for pattern in rule.files.split()):
            text = re.sub(rule.pattern, rule.instead, text)
    return text


PLACES = (
    Rule(
        "*",
        r"/[^\s'\"]*/pytest-of-[^/\s]+/pytest-\d+/(?:popen-gw\d+/)?[^/\s'\":,]+",
        "<tmp>",
        "folders of a test are numbered, by the worker that it runs in",
    ),
    Rule("*", r"/tmp/(?:[a-z]+-|tmp)\w{8}\b", "<tmp>", "temporary folders are named by chance"),
    Rule("*", r"/fmus/[0-9a-f]{64}", "/fmus/<hash>", "kept by the text of the compiler's sources"),
    Rule(
        "*",
        r"(workbench|here) (?:none|[0-9a-f]{16})\b",
        r"\1 <hash>",
        "of the code of a cluster's workers, which are listed by their ports",
    ),
    Rule(
        "*",
        r"(<tmp>/checkpoint\.json: .*)column \d+ \(char \d+\)",
        r"\1<place>",
        "durations before it have more digits or less",
    ),
    Rule("*", r"tcp://[\d.]+:\d+", "tcp://<address>", "ports are given by the system"),
    Rule(
        "*",
        r"\S*\.\.\. \(\d+ characters\)|\S{100,}\.\.\.",
        "<cut>",
        "of a text that is cut a longer folder leaves less",
    ),
)

RESULTS = (
    Rule(
        "*.json* stdout",
        r'("(?:seconds|date|checksum|plain_hours)": )[^,}\n]+',
        r"\1<time>",
        "the day and durations of a run, and sums over these",
    ),
    Rule(
        "*.json* *.html stdout",
        r"\b[0-9a-f]{40}(?:-dirty)?\b",
        "<commit>",
        "two states of the code are compared",
    ),
    Rule(
        "*.json*",
        r'("(?:identity|rig|code|source_sha256)": )"[0-9a-f]{64}"',
        r"\1<hash>",
        "of all that a search depends on, with the folder of its system, and of Python files",
    ),
    Rule("*.json", r'("diagnosis": )"[0-9a-f]{64}"', r"\1<hash>", "of a file that has a date"),
    Rule("*.html", r"(<dt>diagnosis</dt><dd>SHA-256 <code>)\w+", r"\1<hash>", "the same"),
    Rule("*.svg", r"\b(?:C\d+_\d+_|[pmh])[0-9a-f]{10}\b", "<id>", "marks are named by chance"),
    Rule("stderr", r"(?m)^ *\d+\.\d s  ", "<time> s  ", "progress tells the time since it began"),
    Rule("stderr", r" +\d+\.\d s, about \d+ s left", " <time>", "progress tells how long it takes"),
    Rule("stderr", r"\d+ evaluations/s", "<speed>", "machines have other work to do"),
    Rule("stderr", r"(?:about|at most) \d+ s left", "<time>", "the same"),
    Rule("stdout", r"(?m)^(time of .*?) +[\d.e+-]+( +\d+  us)$", r"\1 <time>\2", "calls are timed"),
    Rule(
        "stdout",
        r'"value": [^,]+(,\s+"limit": [^,]+,\s+"unit": "us")',
        r'"value": <time>\1',
        "the same for programs",
    ),
    Rule(
        "stderr",
        r"<time> s  \d+ (?:simulations|distributions|runs of|parts of).*\n",
        "",
        "every few seconds progress counts what is done by then",
    ),
    Rule("stdout", r" stops drawn, \S+ ms each", " stops drawn, <time> each", "stops are timed"),
    Rule("stdout", r"(?m) stops, \S+ h$", " stops, <time> h", "and what more of them would take"),
    Rule("safety.csv", r"(?m),[\d.e-]+$", ",<time>", "the same in a table, its last column"),
    Rule("stdout", r"(% of the work saved), \d+ s", r"\1, <time>", "a search takes its time"),
    Rule("stdout", r"\d+ files, \d+ MB", "<size>", "what is kept between runs grows"),
    Rule("*.html", r"\d+ \w+ 20\d\d, \d\d:\d\d UTC", "<date>", "the day and time of the run"),
    Rule("*.html", r'datetime="[^"]+"', "<date>", "the same for programs"),
    Rule(
        "*.html",
        r'(data-value="\d+">\d+</td>\s+<td class="number" )[^>]+>[\d.]+(</td>\s+</tr>)',
        r"\1><time>\2",
        "computing time, the last column of the estimators, behind the number of cases",
    ),
    Rule("*.html", r"(<dt>Time</dt><dd>)[^<]+", r"\1<time>", "how long a search took"),
    Rule("*.html", r"\d{8}-[0-9a-f]{8}", "<report>", "number of a report: its date, its hash"),
)
