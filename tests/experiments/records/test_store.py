"""The store of runs against a dictionary: runs, failures, repeats, kills, and two writers."""

import shutil
from pathlib import Path
from threading import Thread

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    invariant,
    rule,
    run_state_machine_as_test,
)
from msgspec.structs import replace

from experiments.records import store

NAMES = st.integers(0, 3).map("touch-hdc-{:012x}".format)
TIMES = st.floats(0.1, 10)


def test_the_store_is_a_dictionary_whatever_happens_to_it(tmp_path, write_run):
    write_run("hdc")
    (template,) = store.read(tmp_path)

    def entry(name, status, seconds):
        return replace(template, id=name, status=status, seconds=seconds)

    class Store(RuleBasedStateMachine):
        def __init__(self):
            super().__init__()
            self.folder = Path(tmp_path) / "store"
            shutil.rmtree(self.folder, ignore_errors=True)
            self.folder.mkdir()
            self.known, self.damaged = {}, 0

        def note(self, name, status, seconds):
            if status == "finished" or self.known.get(name, ("", 0))[0] != "finished":
                self.known[name] = (status, seconds)

        @rule(name=NAMES, status=st.sampled_from(["finished", "failed"]), seconds=TIMES)
        def run_or_repeat(self, name, status, seconds):
            store.append(self.folder, entry(name, status, seconds))
            self.note(name, status, seconds)

        @rule(name=NAMES, share=st.floats(0.01, 0.99))
        def kill_while_a_line_is_written(self, name, share):
            line = store.to_line(entry(name, "finished", 99.0)).encode()
            path = self.folder / store.FILE
            before = path.read_bytes() if path.exists() else b""
            gap = b"" if not before or before.endswith(b"\n") else b"\n"
            path.write_bytes(before + gap + line[: max(1, int(share * len(line)))])
            self.damaged += 1

        @rule(names=st.tuples(NAMES, NAMES), seconds=TIMES)
        def two_at_once(self, names, seconds):
            entries = [entry(name, "finished", seconds) for name in names]
            threads = [
                Thread(target=store.append, args=(self.folder, e)) for e in entries
            ]
            for thread in threads:
                thread.start()
            for thread, name in zip(threads, names, strict=True):
                thread.join()
                self.note(name, "finished", seconds)

        @invariant()
        def reads_as_the_dictionary(self):
            found = list(store.read(self.folder))
            errors = [one for one in found if isinstance(one, ValueError)]
            runs = {r.id: (r.status, r.seconds) for r in found if r not in errors}
            assert runs == self.known
            assert len(errors) == self.damaged
            for name, (status, _) in self.known.items():
                is_found = store.find(self.folder, name) is not None
                assert is_found == (status == "finished")

    few = settings(max_examples=15, stateful_step_count=12, deadline=None)
    run_state_machine_as_test(Store, settings=few)
