"""Directives that print tables of the package: quantities, closures, special points, claims."""

from collections import Counter
from collections.abc import Mapping

from docstrings import linked
from docutils import nodes
from package import FromPackage
from sphinx.application import Sphinx

from chuteflow.branches.results import KINDS
from chuteflow.paper.claims import CLAIMS, VERDICTS, check, shown
from chuteflow.steady import names
from chuteflow.steady.quantities import FIELDS, NUMBERS, VALIDITY, Quantity
from chuteflow.steady.validity import WORDS
from chuteflow.theory.laws import LAWS

#: What the exponents of a quantity's dimension belong to.
_SCALES = (r"\rho_p", "d", r"(g\cos\theta)")


class Quantities(FromPackage):
    """The registry of quantities: ``numbers`` of a flow, ``fields`` of a profile, or those of its ``validity``."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """The table."""
        self.note_package()
        chosen: Mapping[str, Quantity] = {
            "numbers": NUMBERS,
            "fields": FIELDS,
            "validity": VALIDITY,
        }[self.arguments[0]]
        rows = [
            (
                f"`{q.name}`",
                f"`{q.symbol}`",
                f"${q.latex}$",
                scale(q),
                q.unit,
                q.description,
                linked(q.equation, "{{eqn}}`{}`"),
            )
            for q in chosen.values()
        ]
        heading = ("attribute", "in JSON", "symbol", "scale", "SI", "meaning", "paper")
        return [self.table(heading, rows, (20, 10, 8, 16, 8, 28, 10))]


def scale(quantity: Quantity) -> str:
    """What the quantity is scaled with, as a formula."""
    powers = [
        symbol if exponent == 1 else f"{symbol}^{{{_fraction(exponent)}}}"
        for symbol, exponent in zip(_SCALES, quantity.dimension, strict=True)
        if exponent
    ]
    return f"${' '.join(powers)}$" if powers else "1"


def _fraction(exponent: float) -> str:
    return f"{exponent:g}" if exponent == int(exponent) else f"{exponent * 2:g}/2"


class Closures(FromPackage):
    """The table of constitutive laws."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        self.note_package()
        rows = [(f"`{law.name}`", law.description, law.source, f"{law.densest:g}") for law in LAWS.values()]
        return [self.table(("name", "what", "source", r"$\nu^*$"), rows, (15, 50, 25, 10))]


class Names(FromPackage):
    """The limits by which flows are named."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        self.note_package()
        number = {name: f"`{NUMBERS[name].symbol}`" for name in names.LIMITS}
        rows = [
            (number[name], f"{low} below {least:g}", middle or "no word", f"{high} from {most:g}")
            for name, ((least, most), (low, middle, high)) in names.LIMITS.items()
        ]
        return [self.table(("number", "small", "between", "large"), rows, (25, 25, 25, 25))]


class Validity(FromPackage):
    """The words that tell which limits of the theory are passed."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        self.note_package()
        rows = [(word, meaning) for word, meaning in WORDS.items()]
        return [self.table(("word", "where"), rows, (30, 70))]


class SpecialPoints(FromPackage):
    """The kinds of special points of a curve."""

    def run(self) -> list[nodes.Node]:
        """The table."""
        self.note_package()
        rows = [(f"`{kind}`", meaning) for kind, meaning in KINDS.items()]
        return [self.table(("kind", "meaning"), rows, (30, 70))]


class Claims(FromPackage):
    """Every claim, computed now, with its verdict; a count of the verdicts first. In a quick build one of them."""

    def run(self) -> list[nodes.Node]:
        """The sections."""
        self.note_package()
        found = list(check([next(iter(CLAIMS))] if self.quick else None))
        counted = Counter(verdict.verdict for verdict in found)
        said = ", ".join(f"{counted[verdict]} {verdict}" for verdict in VERDICTS if counted[verdict])
        rows = [
            (
                [_plain(f"{claim.statement} ({claim.source})")],
                [_plain(shown(claim.printed))],
                [_plain(shown(claim.computed))],
                [nodes.paragraph("", "", nodes.strong("", claim.verdict)), _plain(claim.reason)],
            )
            for claim in found
        ]
        table = self.table(("statement", "printed", "computed", "verdict"), rows, (30, 13, 17, 40))
        table["classes"] = ["claims"]
        return [_plain(f"{len(found)} claims: {said}."), table]


def _plain(text: str) -> nodes.paragraph:
    """A paragraph in which nothing is markup."""
    return nodes.paragraph("", text)


def setup(app: Sphinx) -> dict[str, bool]:
    """Register the directives."""
    app.add_directive("quantities", Quantities)
    app.add_directive("closures", Closures)
    app.add_directive("names", Names)
    app.add_directive("validity", Validity)
    app.add_directive("special-points", SpecialPoints)
    app.add_directive("claims", Claims)
    return {"parallel_read_safe": True}
