"""A Jupyter kernel for C++: clang-repl behind ipykernel.

Every cell is written to files and included, so that errors carry its name and line: one file for each statement or
declaration, since clang-repl does not keep their order within one. `%lib PATH` loads a shared library. Lines between the bytes 2 and 3 are marks of notebooks-cpp/notebook.hpp: figures, failed checks.
The build writes kernel.json, which says where clang-repl and the library are and how the library was compiled.
"""

import base64
import os
import queue
import re
import shutil
import signal
import subprocess
import tempfile
import threading

from ipykernel.kernelapp import IPKernelApp
from ipykernel.kernelbase import Kernel

MARK = re.compile("\x02(.*?)\x03")
DONE = "\x04"


def chunks(code):
    """(first line, text) of each statement or declaration at the top level; includes stay together."""
    out, text, first, depth = [], [], 1, 0
    lines = code.splitlines()
    for number, line in enumerate(lines, 1):
        if not text:
            first = number
        text.append(line)
        bare = re.sub(r'"(\\.|[^"\\])*"|\'(\\.|[^\'\\])\'', "0", line)  # without strings and characters
        bare = re.sub(r"//.*", "", bare).strip()
        depth += sum(bare.count(c) for c in "([{") - sum(bare.count(c) for c in ")]}")
        following = next((l.strip() for l in lines[number:] if l.strip()), "")
        ends = bare.startswith("#") and not following.startswith("#") or bare.endswith((";", "}"))
        if depth == 0 and ends and not re.match(r"(else|catch)\b", following):
            out.append((first, "\n".join(text)))
            text = []
    if any(re.sub(r"//.*", "", line).strip() for line in text):
        out.append((first, "\n".join(text)))
    return out


class Repl:
    """One clang-repl process: include() yields what a cell prints until it is done."""

    def __init__(self):
        flags = os.environ.get("UNHAND_REPL_FLAGS", "-std=c++20").split(";")
        program = os.environ.get("UNHAND_REPL", "clang-repl-19")
        environment = dict(os.environ, UNHAND_NOTEBOOK_KERNEL="1")
        self.process = subprocess.Popen(
            [program] + ["-Xcc=" + flag for flag in flags if flag],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            text=True, bufsize=1, errors="replace", env=environment, start_new_session=True)
        self.lines = queue.Queue()
        for name in ("stdout", "stderr"):
            threading.Thread(target=self._read, args=(name,), daemon=True).start()
        self.send('extern "C" int puts(const char*); extern "C" int fflush(struct _IO_FILE*);')

    def _read(self, name):
        for line in getattr(self.process, name):
            self.lines.put((name, line))
        self.lines.put((name, None))

    def send(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def include(self, path):
        """(stream, line) until the cell is done; the stream is "end" if the interpreter died."""
        self.send(f'#include "{path}"')
        self.send(f'puts("{DONE}"); fflush(nullptr);')
        while True:
            name, line = self.lines.get()
            if line is None:
                if name == "stdout":
                    yield "end", ""
                    return
            elif name == "stdout" and line.rstrip().endswith(DONE):
                rest = line.rstrip()[:-len(DONE)]  # what a cell printed without an end of line
                if rest:
                    yield name, rest + "\n"
                break
            else:
                yield name, line
        # errors of this cell that the other reader has not passed on yet
        while True:
            try:
                name, line = self.lines.get(timeout=0.01)
            except queue.Empty:
                return
            if line is not None:
                yield name, line

    def stop(self):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()


class UnhandKernel(Kernel):
    implementation = "unhand-cpp"
    implementation_version = "1"
    language = "c++"
    language_info = {"name": "c++", "mimetype": "text/x-c++src", "file_extension": ".cpp",
                     "codemirror_mode": "text/x-c++src", "pygments_lexer": "cpp"}
    banner = "C++ with unhand"

    def __init__(self, **arguments):
        super().__init__(**arguments)
        self.folder = tempfile.mkdtemp(prefix="unhand-kernel-")
        os.environ.setdefault("UNHAND_NOTEBOOK_FIGURES", self.folder)
        self.repl = None

    def start_repl(self):
        self.repl = Repl()
        library = os.environ.get("UNHAND_LIBRARY")
        if library:
            self.repl.send("%lib " + library)

    def do_execute(self, code, silent, store_history=True, user_expressions=None, allow_stdin=False):
        if self.repl is None:
            self.start_repl()
        text = []
        for line in code.splitlines():
            if line.startswith("%lib "):
                self.repl.send(line)
                line = ""
            text.append(line)
        name = f"cell-{self.execution_count}.cpp"
        wrong = []
        try:
            for count, (first, chunk) in enumerate(chunks("\n".join(text))):
                path = os.path.join(self.folder, f"{count}-{name}")
                with open(path, "w", encoding="utf-8") as part:
                    part.write(f'#line {first} "{name}"\n{chunk}\n')
                wrong += self.run(silent, path)
                if wrong:
                    break
        except KeyboardInterrupt:
            self.repl.stop()
            self.repl = None
            wrong.append("interrupted; the next cell starts a new interpreter")
        if not wrong:
            return {"status": "ok", "execution_count": self.execution_count, "payload": [], "user_expressions": {}}
        error = {"ename": "Error", "evalue": wrong[0], "traceback": wrong}
        if not silent:
            self.send_response(self.iopub_socket, "error", error)
        return {"status": "error", "execution_count": self.execution_count, **error}

    def run(self, silent, path):
        """Includes a file, passes on what it prints, gives what went wrong."""
        wrong = []
        for name, line in self.repl.include(path):
            if name == "end":
                self.repl = None
                wrong.append("the interpreter died; the next cell starts a new one")
                break
            if name == "stdout":
                wrong += self.show(silent, line)
                continue
            if re.search(r"\berror:", line):
                wrong.append(line.strip())
            if "<<< inputs >>>" not in line and "input_line_" not in line and "error: Parsing failed." not in line:
                self.stream(silent, "stderr", line)
        return wrong

    def stream(self, silent, name, text):
        if text and not silent:
            self.send_response(self.iopub_socket, "stream", {"name": name, "text": text})

    def show(self, silent, line):
        """Passes on what was printed; gives the checks that failed."""
        marks = MARK.findall(line)
        if not marks:
            self.stream(silent, "stdout", line)
            return []
        failed = []
        for mark in marks:
            kind, _, rest = mark.partition(" ")
            if kind == "failed":
                failed.append("check failed: " + rest)
            elif kind == "png" and not silent:
                with open(rest, "rb") as picture:
                    data = base64.b64encode(picture.read()).decode()
                self.send_response(self.iopub_socket, "display_data",
                                   {"data": {"image/png": data}, "metadata": {"image/png": {"width": 680}}})
        return failed

    def do_shutdown(self, restart):
        if self.repl:
            self.repl.stop()
            self.repl = None
        shutil.rmtree(self.folder, ignore_errors=True)
        return {"status": "ok", "restart": restart}


if __name__ == "__main__":
    IPKernelApp.launch_instance(kernel_class=UnhandKernel)
