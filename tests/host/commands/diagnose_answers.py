#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the JSON of `flexcomp diagnose` must say: diagnose_answers.py CASE FILE [FILE]."""
import json, sys


def named_and_nothing_else(j):
    assert j["verdict"] == "named", j["verdict"]
    (e,) = j["effects"]
    assert (e["effect"], e["joint"], e["order"]) == ("gear_harmonic", 3, 2), e
    for key, true in (("sin_rad", 3e-4), ("cos_rad", 1e-4)):
        assert abs(e["coefficients"][key] - true) < 5 * e["sigma"][key], key
        assert 0 < e["sigma"][key] < 3e-5, key
    assert e["pushed"] is True and e["p_value"] < 0.01 and e["delta_bic"] > 10
    assert isinstance(e["confounded_with"], list)
    where = j["where"]
    assert where["place"].startswith("link3.") and where["joint"] == 3 and "q3" in where["covariates"], where
    assert len(where["around_deg"]) == len(where["covariates"]) and 0 < where["explains"] <= 1


def the_gap_shrinks_where_nothing_was_fitted(j):
    g = j["gap"]
    assert abs(g["noise_floor_mm"] - 3 ** 0.5 * 0.035) < 1e-9, g
    for rms in ("train_rms_mm", "holdout_rms_mm"):
        left = [max(0, g[w][rms] ** 2 - g["noise_floor_mm"] ** 2) for w in ("before", "after")]
        assert left[1] < 0.2 * left[0], (rms, g)
    assert g["after"]["holdout_rms_deg"] < g["before"]["holdout_rms_deg"]


def the_same_without_holdout(j, k):
    for w in ("before", "after"):
        for rms in ("holdout_rms_mm", "holdout_rms_deg"):
            assert k["gap"][w].pop(rms) is None and j["gap"][w].pop(rms) is not None
    for g in (j["gap"], k["gap"]): g.pop("holdout_noise_floor_mm", None)
    assert json.dumps(j) == json.dumps(k)


def and_validates_to_the_numbers_that_were_promised(j, k):
    assert abs(j["gap"]["after"]["holdout_rms_mm"] - k["after"]["rms_mm"]) < 1e-9


def none(j):
    assert j["verdict"] == "none" and j["effects"] == []
    assert j["gap"]["before"]["holdout_rms_mm"] is None


def not_testable_names_the_columns(j):
    needs = {n["effect"]: n["needs"] for n in j["not_testable"]}
    assert needs["readout_lag"] == ["move%d_deg" % i for i in range(1, 7)], needs
    assert "backlash" in needs and any(c.startswith(("dir", "move")) for c in needs["backlash"]), needs
    assert "temp_c" in needs["thermal_growth"] and "time_s" in needs["base_drift"], needs
    assert "gear_harmonic" not in needs


def every_effect_is_joint_3_s_and_rivals_are_named(j):
    assert j["verdict"] == "named", j["verdict"]
    assert all(e["joint"] == 3 for e in j["effects"]), j["effects"]
    assert {"effect", "joint", "delta_bic"} <= set(j["effects"][0]["confounded_with"][0])
    assert any("encoder_scale" in (e["effect"], *(r["effect"] for r in e["confounded_with"])) for e in j["effects"])
    assert len(j["telling_deg"]) == len(j["telling_payload_kg"]) > 0


def unnamed_where_it_is_and_what_it_follows(j):
    assert j["verdict"] == "unnamed", j["verdict"]
    w = j["where"]
    assert (w["place"], w["joint"], set(w["covariates"])) == ("link3.theta", 3, {"q2", "payload_kg"}), w
    assert "unnamed" not in [e["effect"] for e in j["effects"]] and j["unnamed"], j["unnamed"]
    g = j["gap"]
    left = [max(0, g[when]["holdout_rms_mm"] ** 2 - g["noise_floor_mm"] ** 2) for when in ("before", "after")]
    assert left[1] < 0.5 * left[0], g


globals()[sys.argv[1]](*(json.load(open(name)) for name in sys.argv[2:]))
