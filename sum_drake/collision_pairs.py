"""Pairs of links that may touch, as a URDF's collision filter groups and an SRDF say."""

import itertools
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

from sum_drake.assets import InputError
from sum_drake.urdf import parse_xml, some_of


def _pair(a: str, b: str) -> tuple[str, str]:
    return (a, b) if a < b else (b, a)


def filter_groups(root: ElementTree.Element, links: set[str], path: Path) -> set[tuple[str, str]]:
    """Pairs, each sorted, that the URDF's drake:collision_filter_group tags let touch."""
    members: dict[str, list[str]] = {}
    ignored: list[tuple[str, str]] = []
    for group in (element for element in root if _tag(element) == "collision_filter_group"):
        name = group.get("name", "")
        members[name] = [str(child.get("link")) for child in group if _tag(child) == "member"]
        others = [str(child.get("name")) for child in group if _tag(child) == "ignored_collision_filter_group"]
        ignored += [(name, other) for other in others]
        for link in members[name]:
            if link not in links:
                raise InputError(f"{path}: collision filter group '{name}': there is no link '{link}'; expected a link")
    pairs = itertools.chain.from_iterable(itertools.product(members.get(a, []), members.get(b, [])) for a, b in ignored)
    return {_pair(a, b) for a, b in pairs if a != b}


def _tag(element: Any) -> str:
    return str(element.tag).rpartition("}")[2].rpartition(":")[2]


def srdf_pairs(
    srdf: Path, links: set[str], disabled: set[tuple[str, str]], urdf: Path, notes: list[str]
) -> set[tuple[str, str]]:
    """`disabled` and what the SRDF adds to it: MoveIt's disable_collisions, disable_default_collisions and enable_."""
    unknown: dict[str, None] = {}
    pairs = set(disabled)

    def known(element: ElementTree.Element, *keys: str) -> list[str] | None:
        named = [element.get(key) for key in keys]
        if not all(named):
            raise InputError(f"{srdf}: a {element.tag} has no {keys[named.index(None)]}; expected the name of a link")
        lacking = [str(link) for link in named if link not in links]
        unknown.update(dict.fromkeys(lacking))
        return None if lacking else [str(link) for link in named]

    root = parse_xml(srdf, "an SRDF")
    for element in root.findall("disable_default_collisions"):
        found = known(element, "link")
        if found:
            pairs |= {_pair(found[0], link) for link in links if link != found[0]}
    for tag, change in (("enable_collisions", pairs.discard), ("disable_collisions", pairs.add)):
        for element in root.findall(tag):
            found = known(element, "link1", "link2")
            if found and found[0] != found[1]:
                change(_pair(*found))
    if unknown:
        quoted = [f"'{link}'" for link in unknown]
        notes.append(f"{srdf}: names links that {urdf.name} lacks: {some_of(quoted)}; expected its links, passed over")
    return pairs
