"""What is counted of a run, and how much of it is named."""

from shrm_cli.batch.log import Totals
from shrm_cli.cli import batch


def counted(status, words, count):
    totals = Totals(count)
    for number in range(count):
        totals.add({"status": status, words: f"because of {number}"})
    return totals


def test_the_first_thousand_failures_are_named_and_all_are_counted():
    totals = counted("failed", "error", 1005)
    assert totals.failed == totals.done == 1005
    assert [each["error"] for each in totals.failures[::999]] == ["because of 0", "because of 999"]
    assert len(totals.failures) == 1000


def test_reasons_are_counted_as_far_as_they_are_few(capsys):
    totals = counted("made", "why", 130)
    totals.add({"status": "made", "why": "because of 3"})
    totals.add({"status": "made", "why": "because of 120"})
    assert len(totals.as_json()["anew"]) == 100
    assert totals.anew.most_common(1) == [("because of 3", 2)]
    batch._conclude(totals, None, [])
    lines = capsys.readouterr().out.splitlines()
    assert next(line for line in lines if "anew" in line) == "  2 anew: because of 3"
    assert len(lines) == 1 + 5
