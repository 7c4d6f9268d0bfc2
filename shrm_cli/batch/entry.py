"""What a batch makes: the product of probes, BRDFs and forms, and the names of the outputs."""

import glob
import os
import re
from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import field, replace
from pathlib import PurePath
from typing import Any

from shrm_cli.batch.job import Chunk, Job, Recipe
from shrm_cli.batch.made import without_outputs
from shrm_cli.brdf.spec import named_files, names_file, parse_spec
from shrm_cli.errors import ArgumentError, OutputError, ProbeError
from shrm_cli.files.exr_header import holds_nothing, is_output
from shrm_cli.files.remote import matching
from shrm_cli.files.whole import is_input
from shrm_cli.maps import registry
from shrm_cli.maps.options import Representation, counted, listing, owners
from shrm_cli.maps.request import check_arguments, checked_options, over, resolved_form
from shrm_cli.messages import check_fields, check_kind, is_remote, several, shown
from shrm_cli.naming import brdf_label, probe_stem, unsound
from shrm_cli.probe.open import face_paths
from shrm_cli.records import record
from shrm_cli.vocabulary import AUTO, CONTAINERS, ENGINES, EXPORT, Precision

DEFAULT_OUTPUT = "{probe}.{brdf}.{to}.exr"
DEFAULT_FOLDER = "{probe}.{engine}"
"""Where exports go, unless a name is given."""
FIELDS = ("probe", "folder", "brdf", "to", "engine")
"""What the names of outputs may hold in braces."""
_FIELD = re.compile(r"([-._/ ]?)\{([^{}]*)\}")
_SEPARATORS = "-._/ "
_MOST_OF_A_PATTERN = 4096
"""The most characters of a pattern: no system has longer names, and `glob` takes their square."""
_Names = Sequence[str | os.PathLike[str]] | str | os.PathLike[str]


@record
class Entry:
    """Maps that are made with the same options.

    Attributes
    ----------
    probes : tuple of str
        Paths, URLs, or patterns of them such as ``probes/**/*.exr``.
    brdfs : tuple of str
        Specifications.
    to : tuple of str
        Representations. ``auto`` stands for an SHRM where the arguments are those of one.
    output : str
        The name of the outputs, in which ``{probe}`` stands for the name of the probe's file
        without its suffix, ``{folder}`` for its folders below those that the pattern names,
        ``{brdf}`` for the BRDF and ``{to}`` for the representation. What is empty, as the BRDF of
        irradiance is, takes the separator before it along. ``{engine}`` is that of an export.
    arguments : mapping of str to value
        Arguments of `shrm_cli.prefilter.prefilter` for all forms that obey them.
    own : mapping of str to mapping
        Arguments for single forms, by the names of the forms; they come before those for all, and
        an error takes the place of what it chooses, such as `eps`, and the reverse.
    reading : mapping of str to value
        Keywords of `shrm_cli.probe.open.open_probe`.
    precision : {"auto", "half", "float"}
    runs_code : bool
        Whether BRDFs may be classes in Python files, which are run.
    engines : tuple of str
        Those that exports are for.

    Examples
    --------
    >>> entry = shrm.Entry(("probes/s*.exr",), ("lambertian",), output="{probe}.{brdf}.exr")
    >>> shrm.batch([entry], jobs=1, terms=shrm.Terms(only_looks=True)).jobs
    2
    """

    probes: tuple[str, ...]
    brdfs: tuple[str, ...] = ()
    to: tuple[str, ...] = (AUTO,)
    output: str = DEFAULT_OUTPUT
    arguments: Mapping[str, Any] = field(default_factory=dict)
    own: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    reading: Mapping[str, Any] = field(default_factory=dict)
    precision: Precision = "auto"
    runs_code: bool = False
    engines: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("probes", "brdfs", "to", "engines"):
            check_kind(name, getattr(self, name), _Names)
            texts = tuple(os.fspath(each) for each in several(getattr(self, name)))
            object.__setattr__(self, name, texts)
        check_fields(self)
        resolved = tuple(resolved_form(to, self.arguments) for to in self.to)
        object.__setattr__(self, "to", resolved)

    def recipes(self) -> list[Recipe]:
        """Return what is made of each probe.

        Raises
        ------
        ArgumentError
            If a form is unknown or lacks a BRDF, or an argument has a value that it cannot have,
            or applies to none of the forms.
        BrdfError
            If there is no such BRDF, or a form is of no such BRDFs.
        """
        self._refuse_idle()
        found = []
        for to in dict.fromkeys(self.to):
            if to == EXPORT:
                found += self._exports()
                continue
            given = self._arguments(to)
            specs = tuple(dict.fromkeys(self.brdfs)) if self._has_brdf(to) else (None,)
            for spec in filter(None, specs):
                self._check_brdf(to, spec)
            found += [Recipe(to, spec, given, self.precision, self.runs_code) for spec in specs]
        return found

    def _check_brdf(self, to: str, spec: str) -> None:
        """Refuse a BRDF of which no probe has a map; those in files are left to the work."""
        if names_file(spec) or named_files(spec):
            return
        brdf = parse_spec(spec, run_code=self.runs_code)
        if not self._form(to).needs_brdf:  # others tell what they hold when they are made
            check = getattr(registry.module(to, "prefilter"), "check_brdf", None)
            if check is not None:
                check(brdf)

    def _exports(self) -> list[Recipe]:
        """Return what is made of each probe for the engines."""
        from shrm_cli.batch.exports import DESCRIPTION, checked

        if not self.engines:
            raise ArgumentError("for", f"is missing; `to` {EXPORT} needs an engine")
        named = {key: each for key, each in self.arguments.items() if key in DESCRIPTION.arguments}
        own = self.own.get(EXPORT, {})
        found = checked({**named, **own}, dict.fromkeys(self.engines))
        return [Recipe(EXPORT, None, each) for each in found]

    def _has_brdf(self, to: str) -> bool:
        """Tell whether a form is made of the BRDFs.

        Split sums are, unless the BRDFs are for other forms, beside which they are of GGX.
        """
        if self._form(to).needs_brdf:
            return True
        is_for_others = any(self._form(each).needs_brdf for each in self.to)
        takes_one = "brdf" in self._form(to).arguments
        return takes_one and bool(self.brdfs) and not is_for_others

    def _form(self, to: str) -> Representation:
        """Return the description of a representation, or that of exports."""
        if to != EXPORT:
            return registry.description(to)
        from shrm_cli.batch.exports import DESCRIPTION  # plain batches export nothing

        return DESCRIPTION

    def jobs(self, left_out: list[str] | None = None) -> list[Job]:
        """Return all jobs, those of one probe after the other.

        Parameters
        ----------
        left_out : list of str, optional
            Gets the names of files that patterns match, and that are no probes; see `found_probes`.

        Raises
        ------
        ArgumentError
            As of `recipes`.
        ProbeError
            If a pattern matches nothing.
        OutputError
            If the name of the outputs is unsound.
        """
        recipes = self.recipes()
        if not self.probes:
            raise ProbeError("no probes; name some, such as 'probes/*.exr'")
        found = [
            Job(probe, self.reading, recipe, self._output(probe, folder, recipe))
            for probe, folder in found_probes(self.probes, left_out)
            for recipe in recipes
        ]
        made = self._matched_outputs(found)
        if left_out is not None:
            left_out += made
        return [job for job in found if job.probe not in made]

    def _matched_outputs(self, jobs: list[Job]) -> set[str]:
        """Return what patterns match and what is the output of another probe among them.

        Of a listing from elsewhere nothing is known but names, nor of what is cut off so soon that
        it does not say what it is.
        """
        of = {_plain(job.output): job.probe for job in jobs}
        return {
            job.probe
            for job in jobs
            if job.probe not in self.probes
            and of.get(_plain(job.probe), job.probe) != job.probe
            and (is_remote(job.probe) or holds_nothing(job.probe))
        }

    def _arguments(self, to: str) -> dict[str, Any]:
        """Return the arguments that a form is made with, checked."""
        chosen = registry.description(to)
        given = {name: each for name, each in self.arguments.items() if name in chosen.arguments}
        given = over(given, self.own.get(to, {}), chosen.chosen)
        check_arguments(to, [*given, *(["brdf"] if self.brdfs and self._has_brdf(to) else [])])
        return checked_options(to, given)

    def _refuse_idle(self) -> None:
        """Refuse arguments and BRDFs that nothing is made with."""
        known = self._known_forms()
        for name in self.arguments:
            if not owners(known, name):
                raise ArgumentError(name, "is no argument of prefilter")
        for error in self.idle().values():
            raise error

    def _known_forms(self) -> dict[str, Representation]:
        """Return the descriptions of all forms that the entry may name; others are refused."""
        known = {AUTO: registry.description(AUTO), **registry.descriptions()}
        others = [to for to in (*self.to, *self.own) if to not in known]
        return known | {to: self._form(to) for to in others}

    def idle(self) -> dict[str, ArgumentError]:
        """Return why nothing is made with a key of a manifest, by these keys."""
        found = {}
        if self.engines and EXPORT not in self.to:
            found["for"] = ArgumentError("for", f"applies with `to` {EXPORT}")
        for to in self.own:
            if to not in self.to:
                told = f"does not name {to}, which has options of its own"
                found[to] = ArgumentError("to", told)
        known = self._known_forms()
        for name in self.arguments:
            of = owners(known, name)
            if of and not set(of) & set(self.to):
                found[name] = ArgumentError(name, f"applies with `to` {listing(of, 'or')}")
        if self.brdfs and not any(map(self._has_brdf, self.to)):
            found["brdfs"] = ArgumentError("brdf", f"says nothing to {listing(self.to, 'and')}")
        return found

    def without_idle(self, keys: Container[str]) -> "Entry":
        """Return the entry without those of some keys of a manifest that nothing is made with."""
        idle = [key for key in self.idle() if key in keys]
        return replace(
            self,
            brdfs=() if "brdfs" in idle else self.brdfs,
            engines=() if "for" in idle else self.engines,
            own={to: each for to, each in self.own.items() if to not in idle},
            arguments={name: each for name, each in self.arguments.items() if name not in idle},
        )

    def _output(self, probe: str, folder: str, recipe: Recipe) -> str:
        values = {
            "probe": probe_stem(probe),
            "folder": folder,
            "brdf": "" if recipe.brdf is None else brdf_label(recipe.brdf),
            "to": recipe.to,
            "engine": recipe.arguments["engine"] if recipe.to == EXPORT else "",
        }
        is_plain = recipe.to == EXPORT and self.output == DEFAULT_OUTPUT
        template = DEFAULT_FOLDER if is_plain else self.output

        def without_empty(found: re.Match[str]) -> str:
            name = found[2]
            if name not in values:
                known = ", ".join(f"{{{each}}}" for each in FIELDS)
                raise OutputError(f"{self.output}: {{{name}}} stands for nothing; give {known}")
            return found[0] if values[name] else ""

        def put(found: re.Match[str]) -> str:
            separator, name = found.groups()
            value = values[name]
            if why := unsound(value):  # as names in a server's listing may be
                raise ProbeError(
                    f"{shown(probe)}: {{{name}}} would be {value!r:.100}, which may lead out of "
                    f"the folder of the outputs ({why}); leave that probe out, or name it another "
                    "way"
                )
            return separator + value

        left = _FIELD.sub(without_empty, template)
        # A separator is cut off before the values are put in, which may begin with one: `_sky.exr`.
        is_cut = template.startswith("{") and left[:1] in _SEPARATORS
        return _FIELD.sub(put, left[1:] if is_cut else left)


def every_engine(names: Iterable[str]) -> tuple[str, ...]:
    """Return the engines that some names stand for: ``all`` are all of them."""
    names = tuple(names)
    return tuple(ENGINES) if "all" in names else names


def found_probes(
    patterns: Iterable[str], left_out: list[str] | None = None
) -> list[tuple[str, str]]:
    """Return the probes that patterns match, and their folders below those that patterns name.

    What `shrm` wrote is left out, but where its name is given and no pattern.

    A name of `patterns` that exists is no pattern, whatever it holds. One with no ``*``, ``?`` or
    ``[`` is taken as it is, with ``%`` for six faces too. `left_out` gets the names of files that
    patterns match, and that `shrm` made or that hold no light: maps, pictures, meshes. Elsewhere
    than on disk they are known by their names alone.

    Returns names of files and of patterns in the order of the patterns, and of the alphabet within
    each; each probe once.
    """
    found: dict[str, str] = {}
    outputs: dict[str, None] = {}
    for pattern in patterns:
        if os.path.isdir(pattern):
            within = os.path.join(pattern, "*.exr")
            raise ProbeError(f"{pattern}: a folder; name what is in it, such as '{within}'")
        if not glob.has_magic(pattern) or os.path.exists(pattern):
            found.setdefault(pattern, "")
            continue
        if len(pattern) > _MOST_OF_A_PATTERN:
            raise ProbeError(f"{shown(pattern)[:99]} ...: too long for a pattern; shorten it")
        names = matching(pattern) if is_remote(pattern) else _files(pattern)
        if not names:
            raise ProbeError(f"{shown(pattern)}: matches no file; quote and correct the pattern")
        for name in names:
            _check_listed(name, _below(name, pattern), pattern)
        probes, made = without_outputs(names, pattern)
        if not probes:
            raise ProbeError(
                f"{shown(pattern)}: matches no probe, only {counted(len(names), 'file')} that shrm "
                "made, or that hold no light; correct the pattern, or name one of them whole"
            )
        for name in probes:
            found.setdefault(name, _below(name, pattern))
        outputs.update(dict.fromkeys(made))
    if left_out is not None:
        left_out += [name for name in outputs if name not in found]
    return list(found.items())


def _check_listed(name: str, folder: str, pattern: str) -> None:
    """Refuse names that a server or a store should not list, whatever is made of them."""
    why = is_remote(pattern) and unsound("/".join(filter(None, (folder, PurePath(name).name))))
    if why:
        raise ProbeError(
            f"{shown(pattern)}: the listing has {shown(name)!r:.200} ({why}); do not trust it, or "
            "name its files one by one"
        )


def _files(pattern: str) -> list[str]:
    return sorted(name for name in glob.glob(pattern, recursive=True) if os.path.isfile(name))


def _below(name: str, pattern: str) -> str:
    """Return the folders of a file below those that its pattern names, joined by ``/``."""
    fixed = 0
    for part in PurePath(pattern).parts:
        if glob.has_magic(part):
            break
        fixed += 1
    return "/".join(PurePath(name).parts[fixed:-1])


def checked(jobs: list[Job]) -> list[Job]:
    """Return jobs whose outputs have names of their own, and are none of the inputs."""
    inputs = _inputs((job.probe for job in jobs), jobs)
    made: dict[str, Job] = {}
    for job in jobs:
        place = _identity(job.output)
        if job.recipe.to == EXPORT:
            if is_remote(job.output):
                raise OutputError(
                    f"{shown(job.output)}: exports are folders of this machine; name one"
                )
        elif not job.output.lower().endswith(tuple(CONTAINERS)):
            raise OutputError(f"{shown(job.output)}: what is written is .exr; name it so")
        if place in inputs and not is_remote(job.output) and is_output(job.output):
            raise OutputError(
                f"{job.output}: shrm made it, so that it is no probe; leave it out, or quote the "
                "pattern, which then passes over it"
            )
        if place in inputs:
            raise OutputError(
                f"{shown(job.output)}: would overwrite the input; name another output"
            )
        if place in made:
            raise OutputError(_twice(job, made[place]))
        made[place] = job
    return jobs


def check_others(others: Iterable[str], chunks: Sequence[Chunk]) -> None:
    """Check that what a batch writes besides its outputs is none of these, and none of its inputs.

    `others` are paths or URLs of logs, pages, collections and files of farms.
    """
    jobs = [job for chunk in chunks for job in chunk.jobs]
    inputs = _inputs((chunk.probe for chunk in chunks), jobs)
    made = {_identity(job.output) for job in jobs}
    for other in others:
        place = _identity(other)
        if place in inputs or is_input(other):
            raise OutputError(f"{shown(other)}: would overwrite the input; name another output")
        if place in made:
            raise OutputError(
                f"{shown(other)}: is another output of this run; name each differently"
            )
        made.add(place)


def _inputs(probes: Iterable[str], jobs: Iterable[Job]) -> set[str]:
    """Return the places of probes, the six of faces too, and of the files of BRDFs."""
    specs = {job.recipe.brdf for job in jobs}
    found = {str(path) for spec in specs if spec is not None for path in named_files(spec)}
    for probe in probes:
        found |= {probe, *(face_paths(probe) if "%" in probe and not is_remote(probe) else ())}
    return set(map(_identity, found))


def _plain(name: str) -> str:
    return name if is_remote(name) else os.path.normpath(name)


def _identity(name: str) -> str:
    return name if is_remote(name) else os.path.realpath(name)


def _twice(one: Job, other: Job) -> str:
    """Say what two jobs of one output differ in."""
    both = f"{one.output}: of {other.probe} and of {one.probe}"
    if one.probe != other.probe and _identity(one.probe) == _identity(other.probe):
        return f"{both}, which is the same file; name it once"
    if one.probe != other.probe and probe_stem(one.probe) != probe_stem(other.probe):
        return f"{both}; put {{probe}} into the name of the outputs"
    if one.probe != other.probe:
        if os.path.dirname(one.probe) == os.path.dirname(other.probe):
            return f"{both}; rename one of the probes"
        return f"{both}; put {{folder}} into the name of the outputs"
    if one.recipe.brdf != other.recipe.brdf and None not in (one.recipe.brdf, other.recipe.brdf):
        return (
            f"{one.output}: of {other.recipe.brdf} and of {one.recipe.brdf}; put {{brdf}} into the "
            "name of the outputs, or make two entries of them"
        )
    if one.recipe.to == other.recipe.to == EXPORT:
        return f"{one.output}: for two engines; put {{engine}} into the name of the outputs"
    if one.recipe.to != other.recipe.to:
        return f"{one.output}: of two forms; put {{to}} into the name of the outputs"
    return f"{one.output}: made twice of {one.probe}; name the outputs of each entry differently"
