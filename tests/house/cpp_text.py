# SPDX-License-Identifier: Apache-2.0
"""Just enough C++ to find functions: good for code that clang-format has laid out."""
import re

RAW_STRING = re.compile(r'R"([^()\\ ]{0,16})\((.*?)\)\1"', re.S)
# Comments, texts and characters, in the order in which they stand; digit separators are none.
NOISE = re.compile(r'//[^\n]*|/\*.*?\*/|"(?:\\.|[^"\\\n])*"|(?<![0-9A-Fa-f])\'(?:\\.|[^\'\\\n])+\'', re.S)
DIRECTIVE = re.compile(r"^[ \t]*#(?:[^\n]*\\\n)*[^\n]*", re.M)
CONTAINER = re.compile(r"(?:^|[\s>])(?:namespace|class|struct|union|enum|extern)\b(?![^{]*\)\s*(?:const|noexcept|override)*\s*$)")
FUNCTION = re.compile(r"\)\s*(?:const|noexcept|override|final|mutable|try|requires\b.*|->.*|:.*|&{1,2}|\s)*$", re.S)


def blank(text):
    """The text with comments, strings and directives gone and its lines kept."""
    def keep_lines(match):
        return "\n" * match.group(0).count("\n")

    for pattern in (RAW_STRING, NOISE, DIRECTIVE):
        text = pattern.sub(keep_lines, text)
    return text


def functions(text):
    """(first line, number of lines, name) of every function outside of other functions."""
    text = blank(text)
    open_braces = []  # of each brace: None for a container, else (line, header) or "other"
    start = 0         # of the statement that is being read
    for match in re.finditer(r"[{};]", text):
        at, mark = match.start(), match.group(0)
        inside = any(brace is not None for brace in open_braces)
        if mark == "{":
            header = text[start:at]
            if inside:
                open_braces.append("other")
            elif CONTAINER.search(header.split("=")[0]) and "(" not in header.split("{")[0].split(":")[0]:
                open_braces.append(None)
            elif FUNCTION.search(header):
                first = start + len(header) - len(header.lstrip())
                open_braces.append((text.count("\n", 0, first) + 1, header.strip()))
            else:
                open_braces.append("other")
        elif mark == "}" and open_braces:
            closed = open_braces.pop()
            if isinstance(closed, tuple):
                first, header = closed
                name = re.findall(r"([\w:~]+)\s*\(", header)
                yield first, text.count("\n", 0, at) + 2 - first, name[0] if name else "?"
        if not any(brace is not None for brace in open_braces):
            start = at + 1
