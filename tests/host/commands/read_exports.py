#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The electronic data sheet and the register map (flexcomp.eds, map.csv, map.json) as others read them."""
import configparser, csv, json
eds = configparser.RawConfigParser(strict=True)
eds.optionxform = str
eds.read("flexcomp.eds")
listed = [eds[s][str(k)] for s in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects")
          for k in range(1, int(eds[s]["SupportedObjects"]) + 1)]
assert len(listed) == len(set(listed)) >= 14, listed
for index in listed:
    section = eds[index[2:]]
    assert section["ParameterName"] and int(section["ObjectType"], 0) in (2, 7, 8, 9), index
    if int(section["ObjectType"], 0) == 9:
        subs = [s for s in eds.sections() if s.startswith(index[2:] + "sub")]
        assert len(subs) == int(section["SubNumber"]), index
assert eds["FileInfo"]["FileName"] == "flexcomp.eds" and eds["1018sub2"]["DefaultValue"] == "0x464C5831"
rows = list(csv.DictReader(open("map.csv")))
other = json.load(open("map.json"))["registers"]
assert [(int(r["address"]), r["name"], r["type"]) for r in rows] == [(r["address"], r["name"], r["type"]) for r in other]
assert sum(r["name"] == "command" and r["access"] == "rw" for r in rows) == 1
