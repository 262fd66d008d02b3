"""What several test files share: the repository's own FMUs, cases and sources."""

import json
import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import lxml.html
import pytest

from workbench.case import Case, read_case
from workbench.fmu import FMU

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def root() -> Path:
    return ROOT


@pytest.fixture(scope="session")
def minimal_path() -> Path:
    return ROOT / "fmus" / "fmi2" / "MinimalObserver.fmu"


@pytest.fixture(scope="session")
def reference_path() -> Path:
    return ROOT / "fmus" / "fmi2" / "Reference.fmu"


@pytest.fixture
def minimal(minimal_path: Path) -> Iterator[FMU]:
    with FMU(minimal_path) as fmu:
        yield fmu


@pytest.fixture(scope="session")
def dry_case() -> Case:
    return read_case(ROOT / "cases" / "03_dry_120_3.6")


# Set before the page's own scripts, for a probe to report.
COLLECT = """<script>
const errors = [];
for (const name of ["error", "securitypolicyviolation"]) {
  addEventListener(name, (event) => errors.push(`${event.message ?? event.violatedDirective}`));
}
</script>"""
ANSWER = """
const answer = document.createElement("pre");
answer.id = "probe";
answer.textContent = JSON.stringify({ ...told, errors });
document.body.append(answer);
</script>"""


@pytest.fixture(scope="session")
def probe(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Path, str], dict[str, Any]]:
    """Opens a page as a file in headless Chromium, with a script that fills `told`."""
    chromium = shutil.which("chromium")
    if chromium is None:
        pytest.skip("no chromium")

    def opened(page: Path, script: str) -> dict[str, Any]:
        folder = tmp_path_factory.mktemp("browser")
        probing = f"<script>\nconst told = {{}};\n{script}{ANSWER}</body>"
        text = page.read_text().replace("<head>", "<head>" + COLLECT).replace("</body>", probing)
        (folder / "index.html").write_text(text)
        run = subprocess.run(
            [
                chromium,
                *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic"),
                *("--no-first-run", "--disable-background-networking"),
                *("--disable-component-update", "--disable-sync", "--window-size=1200,900"),
                *("--enable-logging=stderr", "--dump-dom"),
                f"--user-data-dir={folder / 'profile'}",
                (folder / "index.html").as_uri(),
            ],
            capture_output=True,
            text=True,
            timeout=120,
            check=True,
        )
        assert not [line for line in run.stderr.splitlines() if "CONSOLE" in line]
        answer = lxml.html.fromstring(run.stdout.encode()).get_element_by_id("probe")
        return json.loads(answer.text_content())

    return opened
