"""Help texts whose options stand under headings."""

from __future__ import annotations

import click


def command_with_headings(headings: dict[str, list[str]]) -> type[click.Command]:
    """Return a class of commands whose help lists options under headings.

    Parameters
    ----------
    headings : dict of str to list of str
        The names of options' values, by the heading that they stand under. All others come last,
        under ``Running``.
    """
    place = {name: heading for heading, names in headings.items() for name in names}

    class WithHeadings(click.Command):
        def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
            rows: dict[str, list[tuple[str, str]]] = {each: [] for each in (*headings, "Running")}
            for param in self.get_params(ctx):
                record = param.get_help_record(ctx)
                if isinstance(param, click.Option) and record is not None:
                    rows[place.get(param.name or "", "Running")].append(record)
            for heading, records in rows.items():
                if records:
                    with formatter.section(heading):
                        formatter.write_dl(records)

    return WithHeadings
