"""LinuxCNC's own interpreter as judge: a program and its expansion make the same canonical calls.

Its `rs274` (Debian: linuxcnc-uspace) prints them; where it is missing these tests say so and are skipped.
"""

import random
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from gcode.expand.derived import write_expanded
from gcode.expand.expander import Expander, ExpandError
from tests.harness.programs import CORPUS

RS274 = shutil.which("rs274")
pytestmark = [
    pytest.mark.real,
    pytest.mark.skipif(RS274 is None, reason="rs274 (Debian's linuxcnc-uspace) is not installed: NO ORACLE"),
]

_CALL = re.compile(r"\s*[0-9]+\s+N\S+\s+(.*)")
_NUMBER = re.compile(r"-?[0-9]+\.[0-9]+")
# Of the state behind the end of a program, and of remarks, nothing is said about the way there.
_NO_MATTER = ("COMMENT(", "ON_RESET(")


def canonical(program: str, folder: Path) -> tuple[int, list[str]]:
    """Return code and calls."""
    assert RS274 is not None
    path = folder / "program.ngc"
    path.write_text(program)
    # It maps a file in its HOME: two that run at once in the same one kill each other (SIGBUS).
    home = {"HOME": str(folder), "PATH": "/usr/bin:/bin"}
    command = [RS274, "-g", str(path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60, cwd=folder, env=home, check=False)
    calls = [match[1] for line in done.stdout.splitlines() if (match := _CALL.fullmatch(line))]
    return done.returncode, [call for call in calls if not call.startswith(_NO_MATTER)]


def expanded(program: str) -> str:
    lines = program.encode().splitlines()
    return b"".join(write_expanded(Expander("linuxcnc").expand(lines))).decode()


def split_call(call: str) -> tuple[str, list[float]]:
    """rs274 prints four decimals: a value on the edge between two of them may show as either."""
    return _NUMBER.sub("?", call), [float(number) for number in _NUMBER.findall(call)]


def assert_same(program: str, folder: Path, *, least: int, judged: str = "") -> None:
    """`judged`: what LinuxCNC reads instead of `program`, where it needs other spelling."""
    code, wanted = canonical(judged or program, folder)
    assert code == 0, "LinuxCNC does not take the program itself"
    plain = expanded(program)
    code, got = canonical(plain, folder)
    assert code == 0, plain
    assert len(wanted) >= least
    assert len(got) == len(wanted), plain
    for want, have in zip(wanted, got, strict=True):
        name, numbers = split_call(want)
        assert (name, numbers) == (split_call(have)[0], pytest.approx(split_call(have)[1], abs=1.01e-4, rel=1e-9))


def corpus(name: str) -> str:
    path = CORPUS / name
    if not path.is_file():
        pytest.skip("the corpus is not here")
    return path.read_text(encoding="utf-8")


def without_nested_comments(program: str) -> str:
    """rs274 §1: brackets within a comment are an error, to LinuxCNC as to us; the file has them in its remarks."""
    lines = [line for line in program.splitlines() if not re.search(r"\([^)]*\(", line)]
    return "\n".join(lines) + "\n"


def test_conditionals_of_fluidnc(tmp_path: Path) -> None:
    program = without_nested_comments(corpus("fluidnc_conditionals.nc"))
    # LinuxCNC wants a label once in a file, and nothing before it; FluidNC is not so strict, and neither are we.
    labels = iter(range(20_000, 30_000))

    def renamed(match: re.Match[str]) -> str:
        label = f"o{next(labels)}"
        return f"{label} if{match[1]}{label} endif"

    judged = re.sub(r"o999 if(.*?)o999 endif", renamed, program, flags=re.DOTALL)
    judged = re.sub(r"\([^)]*\) *(?=o145 )|(?<=o160 )\([^)]*\)", "", judged)
    assert_same(program, tmp_path, least=15, judged=judged)


@pytest.mark.parametrize(
    ("name", "least"),
    [
        ("camotics_test_ElseIf.ngc", 12),
        ("lcnc_useful_subs.ngc", 50),
        ("lcnc_cds.ngc", 100),
        ("lcnc_3D_Chips.ngc", 4000),
    ],
)
def test_programs_of_the_corpus(name: str, least: int, tmp_path: Path) -> None:
    program = corpus(name)
    if not re.search(r"^\s*(?:n\d+\s*)?m(?:2|02|30)\b", program, re.IGNORECASE | re.MULTILINE):
        program += "\nm2\n"
    # Radius compensation and tools are the machine's business; without them rs274 needs no tool table.
    program = re.sub(r"(?i)\bg4[012]\b|\bt\d+ *m6|\bg43 h\d+|t#<toolno>m6", "", program)
    assert_same(program, tmp_path, least=least)


def test_expressions_of_ucnc(tmp_path: Path) -> None:
    program = corpus("ucnc_expressions.nc")
    lines = [line for line in program.splitlines() if not line.startswith(("$", "(msg, x"))]
    assert_same("\n".join(lines).replace("f20000", "f20000 y0") + "\n", tmp_path, least=45)


def test_the_door_latch_cam(tmp_path: Path) -> None:
    program = corpus("lcnc_cam_nisley.ngc").replace("T #1113 M6", "").replace("G42 D#1113", "G42.1 D3")
    assert_same(program, tmp_path, least=200)


SNIPPETS = """
= precedence
g0 x[2**3**2] y[-2**2] z[1+2*3-4/5]
g0 x[2 or 0 and 0] y[1 or 1 xor 1] z[5 gt 3 and 2]
= signs
#1=3
g0 x[-#1**2] y[1--3] z[+3 - -[2]]
g0 x-#1 y-[3] z+sin[30]
g0 x[2*-3] y[2**-1*4] z[- -2]
= modulo
g0 x[-7 mod 3] y[7 mod -3] z[7.5 mod 2]
= near
g0 x[1 eq 1.0000005] y[1 ne 1.0000005] z[1 ge 1.0000005]
g0 x[1 le 0.9999995] y[1 lt 2 lt 3]
= round
g0 xround[-2.5] yround[2.5] zround[-0.4]
g0 xfix[-2.5] yfup[-2.5] zfix[2.5]
= functions
g0 x[atan[-1]/[-1]] yacos[0.3] zasin[-0.3]
g0 xln[3] yexp[2] zsqrt[2]
g0 xtan[33] yabs[-3] zcos[60]
= old values
#1=3
#1=7 #2=#1
g0 x#1 y#2
#1=1 #1=2
g0 x#1
##1=5
g0 x#2
#1=2 #[#1]=7
g0 x#1 y#2
#3=6 g1 x#3 f100
= names
#<F o O>=3
g0 x#<foo> y[exists[#<foo>]] z[exists[#<bar>]]
o1 sub
#<foo>=9
#<_g>=#<foo>
o1 endsub
o1 call
g0 x#<foo> y#<_g>
= locals
o1 sub
g0 x#1 y#2 z#30
#1=44
#31=5
o1 endsub [#1+1]
#1=7
#3=1
o#3 call [4] [5]
g0 x#<_value> y#1 z#31
o[#3] call [6]
o1 call
g0 x#<_value> y#<_value_returned>
= value is gone
o1 sub
o1 endsub [4]
o2 sub
o2 endsub
o1 call
o2 call
g0x#<_value>y#<_value_returned>
= return
o<a-b> sub
g0x1
o9 return [3]
g0x2
o<a-b> endsub
o<A-B> call
g0x#<_value>
= recursion
o1 sub
g0x#1 y#<_call_level>
o2 if [#1 gt 0]
o1 call [#1-1]
o2 endif
g0 z#1
o1 endsub
o1 call[5]
= repeat
o1 repeat [2.6]
g0 x1
o1 endrepeat
o2 repeat[1.4]
g0x2
o2 endrepeat
o3 repeat[-1]
g0x3
o3 endrepeat
= do
o1 do
g0x#1
o2 if[#1 gt 2]
o1 break
o2 endif
#1=[#1+1]
o1 continue
g0x9
o1 while[#1 lt 10]
= messages
#1=3.5
#<foo bar>=2
(debug,%d#1 #1 %.1f #1 %5.2f#1 %x#1 50%% #1)
(debug,#<foo bar>, #<FooBar>#1#2,#[1+1] #1.5 # 1)
(log,#1)
( debug, %f#1)
(msg,tool #1)
#1=4 (debug,#1)
#1=1 (debug,#1) (hi)
#5599=0
(debug,#1)
= messages of flow
o1 sub (debug,insub)
o1 endsub (debug,end)
o1 call (debug,call)
o2 if[1] (debug,if)
o2 endif (debug,x)
#1=1 (debug,q)
= blanks
# 1 = 5
G 0 x # 1 Y [ 1 + 2 ]
g0 x1 2 . 5
= m98
m98 p100 l2
g0x9
m98 p100
m2
o100
#1=[#1+1]
g0x#1
m99
= elseif
#1=0
o1 while [#1 lt 4]
o2 if [#1 eq 0]
g0x0
o2 elseif [#1 eq 1]
g0x1
o2 elseif [#1 eq 2]
g0x2
o2 else
g0x3
o2 endif
#1=[#1+1]
o1 endwhile
= end inside
o1 sub
o2 if [#1]
m2
o2 endif
g0x1
o1 endsub
o1 call [0]
o1 call [1]
g0x5
"""


def snippets() -> dict[str, str]:
    """The programs above by their titles."""
    parts = [part.partition("\n") for part in SNIPPETS.split("\n= ")[1:]]
    return {title: text + "\n" for title, _, text in parts}


@pytest.mark.parametrize("name", snippets())
def test_one_thing_at_a_time(name: str, tmp_path: Path) -> None:
    assert_same("g21 g90\n" + snippets()[name] + "m2\n", tmp_path, least=6)


REFUSED = [
    "g0 x[1/0]", "g0 x[5 mod 0]", "g0 x[-8**0.5]", "g0 x[0**-1]", "g0 xatan[1]", "g0 x#0", "g0 x#5602", "g0 x#[1.5]",
    "g0 x[]", "g0 x[1", "g0 x[acos[1.001]]", "g0 xsqrt[-1]", "g0 xln[0]", "g0 xexp[800]", "g0 xround[1e5]",
    "g0 xfoo[1]", "g0 x#<nothing>", "#5420=3", "o1 if #1\no1 endif", "o1 endif", "o1 if [1] g0x1\no1 endif",
    "o1 call [1] g0x1", "o1 sub\no1 endsub [1] [2]\no1 call", "o1 call", "o1 break", "g0 x[1 > 0]", "g0 x1.2.3 y[1]",
    "o1 while [0]\no1 while [0]\no1 endwhile\no1 endwhile", "o1 sub\ng0x#<a>\no1 endsub\n#<a>=1\no1 call",
]  # fmt: skip


@pytest.mark.parametrize("program", REFUSED)
def test_what_linuxcnc_refuses_is_refused(program: str, tmp_path: Path) -> None:
    text = f"g21\n{program}\nm2\n"
    assert canonical(text, tmp_path)[0] != 0
    with pytest.raises(ExpandError):
        expanded(text)


class Maker:
    """Makes programs of nested flow and expressions that end and whose numbers stay moderate."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.label = 10
        self.lines: list[str] = ["g21 g90 f500"]
        self.loops: list[tuple[str, str]] = []

    def value(self, depth: int = 0) -> str:
        pick = self.random.randrange(9 if depth < 3 else 3)
        if pick == 0:
            return f"{self.random.uniform(-50, 50):.3f}"
        if pick == 1:
            return self.random.choice(["#31", "#32", "#33", "#1", "#2", "#<a>", "#<_shared>"])
        if pick == 2:
            return str(self.random.randrange(1, 9))
        if pick == 3:
            return f"{self.random.choice(['sin', 'cos', 'abs', 'fix', 'fup', 'round'])}[{self.value(depth + 1)}]"
        if pick == 4:
            return f"atan[{self.value(depth + 1)}]/[{self.value(depth + 1)}]"
        if pick == 5:
            return f"sqrt[abs[{self.value(depth + 1)}]]"
        if pick == 6:
            return f"-{self.bracket(depth + 1)}"
        return self.bracket(depth + 1)

    def bracket(self, depth: int = 0) -> str:
        operators = ["+", "-", "*", "mod 7 +", "gt", "lt", "ge", "le", "and", "or", "xor", "/ 3 -", "** 2 +"]
        text = self.value(depth)
        for _ in range(self.random.randrange(3)):
            text += f" {self.random.choice(operators)} {self.value(depth)}"
        # LinuxCNC reads 256 characters of a line.
        return f"[{text}]" if len(text) < 52 or depth else self.bracket()

    def moderate(self) -> str:
        return f"[{self.bracket()} mod 1000]"

    def move(self) -> None:
        axes = self.random.sample("xyz", self.random.randrange(1, 4))
        words = " ".join(axis + self.moderate() for axis in axes)
        setting = f" #3{self.random.randrange(1, 4)}={self.moderate()}" if self.random.random() < 0.3 else ""
        self.lines.append(f"g{self.random.randrange(2)} {words}{setting}")

    def setting(self) -> None:
        name = self.random.choice(["#31", "#32", "#33", "#1", "#2", "#<a>", "#<_shared>", "#[30 + 2]"])
        self.lines.append(f"{name} = {self.moderate()}")

    def branch(self, depth: int) -> None:
        label = self.next_label()
        self.lines.append(f"{label} if {self.bracket()}")
        self.block(depth + 1)
        for _ in range(self.random.randrange(3)):
            self.lines.append(f"{label} elseif {self.bracket()}")
            self.block(depth + 1)
        if self.random.random() < 0.5:
            self.lines.append(f"{label} else")
            self.block(depth + 1)
        self.lines.append(f"{label} endif")

    def loop(self, depth: int) -> None:
        label, kind = self.next_label(), self.random.choice(["while", "do", "repeat"])
        counter = f"#<_n{label[1:].strip('<>')}>"
        self.lines.append(f"{counter} = 0")
        turns = self.random.randrange(4)
        opening = {"while": f"while [{counter} lt {turns}]", "do": "do", "repeat": f"repeat [{turns}]"}[kind]
        self.lines += [f"{label} {opening}", f"{counter} = [{counter} + 1]"]
        self.loops.append((label, kind))
        self.block(depth + 1)
        self.loops.pop()
        closing = {"while": "endwhile", "do": f"while [{counter} lt {turns}]", "repeat": "endrepeat"}[kind]
        self.lines.append(f"{label} {closing}")

    def leave(self) -> None:
        # LinuxCNC has no break and continue in a repeat, and a fault: when a do ends by its condition after a
        # continue, a later repeat [3] runs six times (2.9). That is no meaning to follow.
        loops = [(label, kind) for label, kind in self.loops if kind != "repeat"]
        if loops:
            label, kind = self.random.choice(loops)
            inner, word = self.next_label(), "break" if kind == "do" else self.random.choice(["break", "continue"])
            self.lines += [f"{inner} if {self.bracket()}", f"{label} {word}", f"{inner} endif"]

    def call(self) -> None:
        arguments = " ".join(self.moderate() for _ in range(self.random.randrange(3)))
        self.lines.append(f"o{self.random.choice(['1', '2', '<sub three>'])} call {arguments}")
        self.lines.append("g0 x#<_value>")

    def block(self, depth: int = 0) -> None:
        for _ in range(self.random.randrange(1, 4)):
            pick = self.random.randrange(8 if depth < 3 else 4)
            if pick < 2:
                self.move()
            elif pick == 2:
                self.setting()
            elif pick == 3:
                self.leave()
            elif pick in (4, 5):
                self.branch(depth)
            elif pick == 6:
                self.loop(depth)
            elif depth < 2:
                self.call()

    def next_label(self) -> str:
        self.label += 1
        return f"o{self.label}" if self.label % 3 else f"o<l{self.label}>"

    def program(self) -> str:
        main, self.lines = self.lines, []
        for name in ("1", "2", "<sub three>"):
            self.lines += [f"o{name} sub", "#<a> = #1"]
            self.block(depth=2)
            self.lines += ["o99 if [#2 gt 500]", f"o{name} return [#1 + 1]", "o99 endif", f"o{name} endsub [#2]"]
        self.lines += [*main, "#<a> = 1", "#<_shared> = 2"]
        for _ in range(6):
            self.block()
        return "\n".join([*self.lines, "m2", ""])


@pytest.mark.parametrize("seed", range(50))
def test_generated_programs(seed: int, tmp_path: Path) -> None:
    program = Maker(seed).program()
    # The subs read a global before the main program sets it.
    assert_same("#<_shared> = 0\n" + program, tmp_path, least=6)
