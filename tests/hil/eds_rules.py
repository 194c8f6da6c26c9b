# SPDX-License-Identifier: Apache-2.0
"""Rules of CiA 306 (DS 306 V1.3, the later CiA 306-1) for an electronic data sheet, one function for each, by a parser of their
own.

    eds_rules.py FILE.eds      prints what breaks a rule; exit status 1 where something does

The text of the standard was not at hand: the clauses 4.1 to 4.5 are those of its table of contents, what they demand is from
memory, and so are all numbers of CiA 301.
"""
import re
import sys

TYPES = {0x05: 1, 0x06: 2, 0x07: 4, 0x08: 4}  # UNSIGNED8, 16, 32, REAL32
TEXT, DOMAIN = 0x09, 0x0F
VARIABLE, DOMAIN_OBJECT, ARRAY, RECORD = 7, 2, 8, 9
LISTS = {"MandatoryObjects": range(0), "OptionalObjects": range(0x1000, 0x10000), "ManufacturerObjects": range(0x2000, 0x6000)}


def number(text):
    """4.2: decimal, hexadecimal with 0x, or octal with a leading 0."""
    if not re.fullmatch(r"0x[0-9A-Fa-f]+|0[0-7]*|[1-9][0-9]*", text):
        raise ValueError(f"'{text}' is no number")
    return int(text, 16 if text[:2] == "0x" else 8 if text[0] == "0" and text != "0" else 10)


class Sheet:
    """Sections and their keys; what the file breaks by its form is in `wrong`."""

    def __init__(self, data):
        self.sections, self.wrong = {}, []
        section = None
        for k, line in enumerate(data.split(b"\r\n"), 1):
            try:
                text = line.decode("ascii")
            except UnicodeDecodeError:
                self.wrong.append(f"4.1 line {k}: not ASCII")
                continue
            if len(line) > 255:
                self.wrong.append(f"4.1 line {k}: longer than 255 characters")
            if "\n" in text or "\r" in text:
                self.wrong.append(f"4.1 line {k}: ends without CR LF")
            if not text or text[0] == ";":
                continue
            head = re.fullmatch(r"\[([^\[\]]+)\]", text)
            entry = re.fullmatch(r"([A-Za-z0-9_]+)=(.*)", text)
            if head:
                section = head.group(1)
                if section.lower() in (name.lower() for name in self.sections):
                    self.wrong.append(f"4.1 [{section}] stands twice")
                self.sections[section] = {}
            elif entry and section:
                if entry.group(1) in self.sections[section]:
                    self.wrong.append(f"4.1 [{section}] {entry.group(1)} stands twice")
                if entry.group(2) != entry.group(2).strip() or not entry.group(2):
                    self.wrong.append(f"4.1 [{section}] {entry.group(1)}: empty, or with spaces around it")
                self.sections[section][entry.group(1)] = entry.group(2)
            else:
                self.wrong.append(f"4.1 line {k}: neither a section nor an entry: {text}")
        if not data.endswith(b"\r\n"):
            self.wrong.append("4.1 the last line has no end")

    def objects(self):
        """Sections of objects and sub-objects with a value: (index, sub or None, keys)."""
        for name, keys in self.sections.items():
            at = re.fullmatch(r"([0-9A-F]{4})(?:sub([0-9A-F]{1,2}))?", name)
            if at and "DataType" in keys:
                yield int(at.group(1), 16), None if at.group(2) is None else int(at.group(2), 16), keys


def need(sheet, section, patterns):
    keys = sheet.sections.get(section)
    if keys is None:
        yield f"[{section}] is missing"
        return
    for key, pattern in patterns.items():
        if key not in keys:
            yield f"[{section}] {key} is missing"
        elif not re.fullmatch(pattern, keys[key]):
            yield f"[{section}] {key}={keys[key]} is not as it has to be"


DATE = r"(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])-\d{4}"
TIME = r"(0[1-9]|1[0-2]):[0-5]\d(AM|PM)"
BYTE = r"25[0-5]|2[0-4]\d|1?\d?\d"
NUMBER = r"0x[0-9A-Fa-f]{1,8}|\d+"


def file_information(sheet):
    "4.3"
    yield from need(sheet, "FileInfo", {
        "FileName": r"[^/\\]{1,255}", "FileVersion": BYTE, "FileRevision": BYTE, "EDSVersion": r"[34]\.0",
        "Description": r".{1,243}", "CreationTime": TIME, "CreationDate": DATE, "CreatedBy": r".{1,245}",
        "ModificationTime": TIME, "ModificationDate": DATE, "ModifiedBy": r".{1,244}"})
    info = sheet.sections.get("FileInfo", {})
    day = lambda key: tuple(info.get(key, "00-00-0000").split("-")[k] for k in (2, 0, 1))
    if day("ModificationDate") < day("CreationDate"):
        yield "modified before it was created"


def device_information(sheet):
    "4.4"
    yield from need(sheet, "DeviceInfo", {
        "VendorName": r".{1,244}", "VendorNumber": NUMBER, "ProductName": r".{1,243}", "ProductNumber": NUMBER,
        "RevisionNumber": NUMBER, "OrderCode": r".{1,245}", "SimpleBootUpMaster": "[01]", "SimpleBootUpSlave": "[01]",
        "Granularity": r"[0-9]|[1-5]\d|6[0-4]", "DynamicChannelsSupported": NUMBER, "GroupMessaging": "[01]",
        "NrOfRXPDO": NUMBER, "NrOfTXPDO": NUMBER, "LSS_Supported": "[01]",
        **{f"BaudRate_{rate}": "[01]" for rate in (10, 20, 50, 125, 250, 500, 800, 1000)}})


def pdos_are_counted(sheet):
    "4.4"
    for key, first in (("NrOfRXPDO", 0x1400), ("NrOfTXPDO", 0x1800)):
        found = sum(f"{index:04X}" in sheet.sections for index in range(first, first + 512))
        if found != number(sheet.sections["DeviceInfo"][key]):
            yield f"{key} is not the number of communication parameters, {found}"
        for index in range(first, first + 512):
            if (f"{index:04X}" in sheet.sections) != (f"{index + 0x200:04X}" in sheet.sections):
                yield f"{index:04X}h or its mapping is missing"


def identity_is_that_of_the_device(sheet):
    "4.4"
    for sub, key in ((1, "VendorNumber"), (2, "ProductNumber"), (3, "RevisionNumber")):
        default = sheet.sections.get(f"1018sub{sub}", {}).get("DefaultValue")
        if default is not None and number(default) != number(sheet.sections["DeviceInfo"][key]):
            yield f"{key} and 1018h:{sub} differ"


def dummies(sheet):
    "4.5.1"
    yield from need(sheet, "DummyUsage", {f"Dummy{k:04X}": "[01]" for k in range(1, 8)})


def lists_of_objects(sheet):
    "4.5.2"
    listed = []
    for name, indices in LISTS.items():
        keys = sheet.sections.get(name)
        if keys is None:
            yield f"[{name}] is missing"
            continue
        count = number(keys.get("SupportedObjects", "0"))
        if list(keys) != ["SupportedObjects", *(str(k) for k in range(1, count + 1))]:
            yield f"[{name}] does not count from 1 to SupportedObjects"
        here = [number(value) for key, value in keys.items() if key != "SupportedObjects"]
        if here != sorted(here):
            yield f"[{name}] is not in order"
        for index in here:
            if indices and index not in indices or name == "OptionalObjects" and index in LISTS["ManufacturerObjects"]:
                yield f"{index:04X}h does not belong into [{name}]"
            if f"{index:04X}" not in sheet.sections:
                yield f"{index:04X}h is listed and not described"
        listed += here
    if not {0x1000, 0x1001, 0x1018} <= {number(v) for v in sheet.sections.get("MandatoryObjects", {}).values()}:
        yield "1000h, 1001h and 1018h are mandatory (CiA 301, 7.5.2)"
    if len(listed) != len(set(listed)):
        yield "an object is listed twice"
    for name in sheet.sections:
        if re.fullmatch(r"[0-9A-F]{4}", name) and int(name, 16) not in listed:
            yield f"{name}h is described and not listed"
        if re.fullmatch(r"[0-9A-F]{4}sub[0-9A-F]{1,2}", name) and name[:4] not in sheet.sections:
            yield f"{name} without its object"


def descriptions(sheet):
    "4.5.3"
    for name, keys in sheet.sections.items():
        at = re.fullmatch(r"([0-9A-F]{4})(sub[0-9A-F]{1,2})?", name)
        if not at:
            continue
        if not 1 <= len(keys.get("ParameterName", "")) <= 241:
            yield f"[{name}] ParameterName has no or too many characters"
        kind = number(keys.get("ObjectType", "0x7"))
        if kind in (ARRAY, RECORD):
            subs = [s for s in sheet.sections if s.startswith(name + "sub")]
            if number(keys.get("SubNumber", "0")) != len(subs) or not subs:
                yield f"[{name}] SubNumber is not the number of its sub-indices, {len(subs)}"
            if set(keys) - {"ParameterName", "ObjectType", "SubNumber", "ObjFlags"}:
                yield f"[{name}] has a value beside sub-indices"
            if f"{name}sub0" not in subs or number(sheet.sections[f"{name}sub0"]["DataType"]) != 5:
                yield f"[{name}] has no sub-index 0 of type UNSIGNED8"
            types = {sheet.sections[s]["DataType"] for s in subs if s != f"{name}sub0"}
            if kind == ARRAY and len(types) != 1:
                yield f"[{name}] is an array of several types"
        elif kind in (VARIABLE, DOMAIN_OBJECT):
            for key in ("DataType", "AccessType"):
                if key not in keys:
                    yield f"[{name}] {key} is missing"
            if keys.get("AccessType") not in ("ro", "wo", "rw", "rwr", "rww", "const"):
                yield f"[{name}] AccessType={keys.get('AccessType')} is none"
            if keys.get("PDOMapping", "0") not in ("0", "1"):
                yield f"[{name}] PDOMapping is 0 or 1"
            unknown = set(keys) - {"ParameterName", "ObjectType", "DataType", "AccessType", "DefaultValue", "PDOMapping",
                                   "LowLimit", "HighLimit", "ObjFlags"}
            if unknown:
                yield f"[{name}] keys that CiA 306 does not have: {sorted(unknown)}"
        else:
            yield f"[{name}] ObjectType={kind} is none"


def default(keys, node=0):
    """The default value as a number; of text as it is; None where there is none."""
    text = keys.get("DefaultValue")
    if text is None or number(keys["DataType"]) in (TEXT, DOMAIN):
        return text
    by_node = text.upper().startswith("$NODEID+")
    return number(text[8:] if by_node else text) + (node if by_node else 0)


def object_codes(sheet):
    "CiA 301, 7.5.2"
    for name, keys in sheet.sections.items():
        if not re.fullmatch(r"1[0-9A-F]{3}", name):
            continue
        index = int(name, 16)
        array = index in (0x1003, 0x1010, 0x1011)
        record = index == 0x1018 or index in range(0x1200, 0x1300) or index in range(0x1400, 0x1C00)
        kind = number(keys["ObjectType"])
        if array and kind != ARRAY or record and kind != RECORD:
            yield f"{name}h is {'an array' if array else 'a record'}"


def default_values(sheet):
    "4.5.3"
    for index, sub, keys in sheet.objects():
        kind = number(keys["DataType"])
        if kind in TYPES and "DefaultValue" in keys and default(keys, 127) >= 1 << 8 * TYPES[kind]:
            yield f"{index:04X}h:{sub} the default value has too many bits"
        if keys["AccessType"] == "const" and "DefaultValue" not in keys:
            yield f"{index:04X}h:{sub} is constant, and its value is not said"
        if kind == DOMAIN and "DefaultValue" in keys:
            yield f"{index:04X}h:{sub} a default value of a DOMAIN"


def highest_sub_index(sheet):
    "4.5.3"
    subs = {}
    for index, sub, keys in sheet.objects():
        if sub is not None:
            subs.setdefault(index, {})[sub] = keys
    for index, keys in subs.items():
        # The history's count is not that of its entries (CiA 301, 7.5.2.4).
        if index != 0x1003 and default(keys[0]) != max(keys):
            yield f"{index:04X}h:0 is not the highest sub-index"


def mapping(sheet):
    "4.5.3"
    for index, sub, keys in sheet.objects():
        if index in range(0x1A00, 0x1C00) and sub:
            value = default(keys)
            at = f"{value >> 16:04X}" + f"sub{value >> 8 & 255:X}"
            mapped = sheet.sections.get(at) or sheet.sections.get(at[:4])
            if not mapped or mapped.get("PDOMapping") != "1" or 8 * TYPES[number(mapped["DataType"])] != value & 255:
                yield f"{index:04X}h:{sub} maps what cannot be mapped: {value:08X}h"
            elif mapped["AccessType"] not in ("ro", "rw", "rwr", "const"):
                yield f"{index:04X}h:{sub} maps what cannot be read"


def comments(sheet):
    "4.7"
    keys = sheet.sections.get("Comments", {"Lines": "0"})
    if list(keys) != ["Lines", *(f"Line{k}" for k in range(1, number(keys["Lines"]) + 1))]:
        yield "[Comments] does not count its lines"


RULES = [file_information, device_information, pdos_are_counted, identity_is_that_of_the_device, dummies, lists_of_objects,
         descriptions, object_codes, default_values, highest_sub_index, mapping, comments]


def broken(data):
    """What breaks a rule, each with its clause."""
    sheet = Sheet(data)
    out = list(sheet.wrong)
    for rule in RULES:
        try:
            out += [f"{rule.__doc__} {text}" for text in rule(sheet)]
        except (KeyError, ValueError) as error:
            out.append(f"{rule.__doc__} {rule.__name__}: {error!r}")
    return out


def spoiled(data):
    """Data sheets with one fault each: every one has to break a rule."""
    text = data.decode()
    change = lambda old, new: (f"{old!r} -> {new!r}", re.sub(old, new, text, count=1, flags=re.M).encode())
    yield from (change(old, new) for old, new in (
        (r"\r\n", "\n"), (r"flexcomp", "fl\u00e9xcomp"), (r"^FileVersion=.*\r\n", ""), (r"^FileRevision=\d+", "FileRevision=256"),
        (r"^CreationDate=\S+", "CreationDate=2026-11-22"), (r"^CreationDate=\d\d", "CreationDate=13"),
        (r"^ModificationDate=\S+", "ModificationDate=01-01-2020"), (r"^CreationTime=\S+", "CreationTime=15:00"),
        (r"^EDSVersion=4.0", "EDSVersion=5.0"), (r"^NrOfTXPDO=1", "NrOfTXPDO=0"), (r"^NrOfRXPDO=0", "NrOfRXPDO=1"),
        (r"^RevisionNumber=.*", "RevisionNumber=0\r"), (r"^BaudRate_800=1\r\n", ""), (r"^Dummy0003=0", "Dummy0003=2"),
        (r"^LSS_Supported=0\r\n", ""), (r"^\[DummyUsage\]", "[Dummies]"), (r"^SupportedObjects=3", "SupportedObjects=4"),
        (r"^1=0x1000", "1=0x1002"), (r"^2=0x1001\r\n", ""), (r"^1=0x2000", "1=0x6000"), (r"^\[2021\]", "[2022]"),
        (r"^\[1018sub4\]", "[1018sub5]"), (r"^SubNumber=5", "SubNumber=4"), (r"^AccessType=ro", "AccessType=r"),
        (r"^AccessType=ro\r\n", ""), (r"^ParameterName=.*\r\n", ""), (r"^PDOMapping=1", "PDOMapping=0"),
        (r"^ObjectType=0x9", "ObjectType=0x8"), (r"^ObjectType=0x7", "ObjectType=0x3"), (r"^DefaultValue=254", "DefaultValue=256"),
        (r"^DefaultValue=254", "DefaultValue="), (r"^DefaultValue=254", "DefaultValue=two"), (r"^DefaultValue=flexcomp\r\n", ""),
        (r"^DefaultValue=0x20020808", "DefaultValue=0x20020810"), (r"^Lines=2", "Lines=3"), (r"^\[1001\]", "[1000]"),
        (r"^PDOMapping=0", "Mapping=0"), (r"^DefaultValue=9\r", "DefaultValue=8\r")))


if __name__ == "__main__":
    with open(sys.argv[1], "rb") as file:
        faults = broken(file.read())
    print(*faults, sep="\n")
    sys.exit(1 if faults else 0)
