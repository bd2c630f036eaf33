# SPDX-License-Identifier: Apache-2.0
"""Compares numbers that pages show with those of the files beside them, each with its own.

A number is right where it is the file's value, rounded to the digits that are shown.
"""
import csv
import json
import math
import re
import statistics
import time
from decimal import Decimal

NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
DEGREES = 180 / math.pi
TABLES = """() => document.querySelectorAll('details').forEach(details => { details.open = true; }) ||
 [...document.querySelectorAll('table')].map(table => [...table.rows].map(
  row => [...row.cells].map(cell => cell.innerText.trim())))"""


def read_json(path):
    return json.loads(path.read_text(encoding="utf-8"))


def read_csv(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def numbers(text):
    return [Decimal(found.replace("−", "-")) for found in NUMBER.findall(text)]


def shows(shown, value):
    """Whether a Decimal is a value, rounded to its own last digit."""
    unit = 10.0 ** shown.as_tuple().exponent
    return abs(float(shown) - value) <= 0.5 * unit * (1 + 1e-6) + 1e-12


def expect(text, *values):
    """The first numbers of a text are these values."""
    found = numbers(text)
    assert len(found) >= len(values), f"{text!r} shows too few numbers, expected {values}"
    for shown, value in zip(found, values):
        assert shows(shown, value), f"{text!r} does not show {value}"


def tables(page, *headers):
    """Rows of each table that has these headers, as dictionaries from header to text."""
    found = []
    for rows in page.evaluate(TABLES):
        if rows and set(headers) <= set(rows[0]):
            found.append([dict(zip(rows[0], row)) for row in rows[1:] if len(row) == len(rows[0])])
    assert found, f"no table has the headers {headers}"
    return found


def facts(page):
    """Names and texts of all lists of facts."""
    return dict(page.evaluate("""() => [...document.querySelectorAll('dt')].map(
        dt => [dt.textContent, dt.nextElementSibling.innerText])"""))


def headline(page):
    return page.locator(".headline").first.text_content()


def pose_of(text, mode, k, name):
    factor = DEGREES if name.endswith("_rad") else 1
    expect(text, factor * mode["pose"][k], factor * math.sqrt(mode["covariance"][k][k]))


def distance(mode, capture, names):
    return math.dist(*[[vector[k] for k, name in enumerate(names) if name.endswith("_m")]
                       for vector in (mode["pose"], capture["truth"])])


def expect_length(text, metres):
    """A length in metres, millimetres or micrometres."""
    factor = {"m": 1, "mm": 1e3, "µm": 1e6}[text.split()[-1]]
    expect(text, factor * metres)


def column(name):
    bare, _, unit = name.rpartition("_")
    return f"{bare} ({'°' if unit == 'rad' else unit})"


def fit_numbers(page, path):
    result = read_json(path.with_name("result.json"))
    capture, names = result["captures"][0], result["unknowns"]
    rows = tables(page, "mode", "weight", "log likelihood")[0]
    assert len(rows) == len(capture["modes"]) + 1  # and the truth
    for row, mode in zip(rows, capture["modes"]):
        expect(row["weight"], 100 * mode["weight"])
        for k, name in enumerate(names):
            pose_of(row[column(name)], mode, k, name)
        expect_length(row["distance to truth"], distance(mode, capture, names))
    expect(rows[0]["log likelihood"], capture["modes"][0]["log_likelihood"])
    fit, shown = capture["goodness_of_fit"], facts(page)
    expect(shown["goodness of fit"], (fit["deviance"] - fit["expected"]) / fit["standard_deviation"],
           fit["deviance"], fit["expected"], fit["standard_deviation"])
    expect(shown["object present"], capture["presence_probability"])
    expect(headline(page), *capture["modes"][0]["pose"][:3])


def track_numbers(page, path):
    result = read_json(path.with_name("result.json"))
    names = result["unknowns"]
    rows = tables(page, "capture", "source", "present")[0]
    assert len(rows) == len(result["captures"])
    for row, capture in zip(rows, result["captures"]):
        mode = capture["modes"][0]
        for k, name in enumerate(names):
            pose_of(row[column(name)], mode, k, name)
        expect(row["weight"], 100 * mode["weight"])
        expect_length(row["to truth"], distance(mode, capture, names))
        if numbers(row["present"]) and "<" not in row["present"] and ">" not in row["present"]:
            expect(row["present"], capture["presence_probability"])
    expect(headline(page), len(rows))


def scene_numbers(page, path):
    from gallery import WALL
    unknowns = read_json(WALL)["unknowns"]
    rows = {row[0]: row[1] for row in page.evaluate(TABLES)[0]}
    for name, limits in unknowns.items():
        bare, _, unit = name.rpartition("_")
        expect(rows[f"{bare} ({'°' if unit == 'deg' else unit})"], *limits)


def index_numbers(page, path):
    links = page.evaluate("[...document.querySelectorAll('a')].map(a => a.getAttribute('href'))")
    assert {"result.html", "evaluation.html", "result.json", "evaluation.json"} <= set(links)
    for link in links:
        assert path.with_name(link).exists(), link
    expect(page.get_by_text("Found at").first.text_content().partition("Found at")[2],
           *read_json(path.with_name("result.json"))["captures"][0]["modes"][0]["pose"][:3])


def evaluation_numbers(page, path):
    row = read_json(path.with_name("evaluation.json"))["rows"][0]
    shown = {line[0].splitlines()[0]: line[1] for line in page.evaluate(TABLES)[0] if len(line) > 1}
    expect(shown["estimates (positions)"], row["estimates"], row["positions"])
    median = shown["heaviest mode to truth"].replace("90th", "")
    expect(median, row["mode_distance_m"]["median"], row["mode_distance_m"]["p90"])
    for name, figure in row["figures"].items():
        factor = DEGREES if name.endswith("_rad") else 1
        text = shown[name.replace("_rad", "_deg")]
        expect(text, *[factor * figure[key] for key in ("value", "low", "high")])


def bound_numbers(page, path):
    found = read_json(path.with_name("bound.json"))["maps"][0]
    row = tables(page, "noticed at", "median error")[0][0]
    expect(row["noticed at"], 100 * found["noticed_share"])
    expect(row["median error"], 100 * found["median_error_m"])  # cm
    expect(row["90 % below"], 100 * found["p90_error_m"])
    expect(row["median photons"], found["median_photons"])
    expect(headline(page), 100 * found["noticed_share"])


def stability_numbers(page, path):
    found = {row["name"]: row for row in read_json(path.with_name("stability.json"))["rows"]}
    rows = tables(page, "case", "measured", "limit")[0]
    assert {row["case"] for row in rows} == set(found)
    for row in rows:
        expect(row["measured"], found[row["case"]]["measured"])
        expect(row["limit"], found[row["case"]]["limit"])
    expect(headline(page), sum(row["verdict"] == "holds" for row in found.values()), len(found))


def drive_numbers(page, path):
    found = read_json(path.with_name("drive.json"))
    frames = found["frames"]
    assert headline(page) == found["headline"]
    assert page.locator("h1 .outcome").text_content() == found["outcome"]
    for keys, i in ((["Home"], 0), (["Home"] + ["ArrowRight"] * 5, 5), (["End"], len(frames) - 1)):
        for key in keys:
            page.keyboard.press(key)
        shown = page.locator(".timelines .reading").all_text_contents()
        for text, name in zip(shown, ("speed_m_per_s", "clearance_m", "presence_probability")):
            expect(text, frames[i][name])
        expect(facts(page)["sensor frame"], i, len(frames) - 1)
        expect(facts(page)["run time"], *[frames[i]["time_ms"][stage] for stage in ("perceive", "map", "plan")])
    expect(page.locator(".clock").text_content(), found["time_s"], found["time_s"])


def side_by_side_numbers(page, path):
    drives = [read_json(path.with_name(name) / "drive.json") for name in ("los", "oracle")]
    page.get_by_label("time of both drives").press("End")
    ends = page.locator(".panel .now").all_text_contents()
    stories = page.locator(".panel .story").all_text_contents()
    for drive, end, story in zip(drives, ends, stories, strict=True):
        expect(end, drive["time_s"])
        assert story.startswith(drive["headline"])
    longest = max(drive["time_s"] for drive in drives)
    expect(page.locator(".clock").text_content(), longest, longest)


def trials_numbers(page, path):
    rows = read_csv(path.with_name("trials.csv"))
    for shown in tables(page, "perception", "mean way to the goal, m")[0]:
        own = [row for row in rows if row["perception"] == shown["perception"]]
        there = [row for row in own if row["outcome"] == "reached"]
        # The table holds times with two decimals, the page has their mean with more.
        assert abs(float(shown["mean time to the goal, s"])
                   - sum(float(row["time_s"]) for row in there) / len(there)) <= 0.011
        assert abs(float(shown["mean way to the goal, m"])
                   - sum(float(row["length_m"]) for row in there) / len(there)) <= 0.0011
    success = tables(page, "speed zone", "los", "oracle")[0]
    assert len(success) == 1
    for name in ("los", "oracle"):
        own = [row for row in rows if row["perception"] == name]
        reached = sum(row["outcome"] == "reached" for row in own)
        expect(success[0][name], reached / len(own))
        assert success[0][name].endswith(f"{reached}/{len(own)}")


def plan_numbers(page, path):
    found = read_json(path.with_name("path.json"))
    shown = dict(page.evaluate(TABLES)[0])
    assert shown["status"] == found["status"]
    expect(shown["length"], found["length_m"])
    expect(shown["cost"], found["cost_m"])
    expect(shown["expansions"], found["expansions"])
    expect(shown["time"], found["time_ms"])
    expect(shown["greatest curvature"], max(abs(point[3]) for point in found["points"]))
    expect(headline(page), found["length_m"])


def compare_numbers(page, path):
    methods = read_json(path.with_name("comparison.json"))["scenes"][0]["conditions"][0]["methods"]
    rows = tables(page, "method", "position, median, m")[0]
    for row, method in zip(rows, methods, strict=True):
        assert row["method"] == method["method"]
        for header, key in (("position, median, m", "position_median_m"), ("90 % within, m", "position_p90_m"),
                            ("RMSE, m", "rmse_m"), ("ms a capture", "time_ms")):
            expect(row[header], *[method[key][end] for end in ("value", "low", "high")])
        expect(row["|x_m|"], method["mean_absolute"]["x_m"]["value"])
        expect(row["|yaw_deg|"], DEGREES * method["mean_absolute"]["yaw_rad"]["value"])


def claims(rows, found):
    for row, claim in zip(rows, found, strict=True):
        assert row["claim"] == claim["claim"]
        expect(row["trials"], claim["trials"])
        expect(row["claimed"], claim["claimed"])
        expect(row["found"], claim["found"])
        expect(row["allowed from"], claim["allowed_low"])
        expect(row["to"], claim["allowed_high"])
        assert (row["verdict"] == "holds") == claim["holds"]


def coverage_numbers(page, path):
    level = read_json(path.with_name("coverage.json"))["scenes"][0]["levels"][0]
    claims(tables(page, "claim", "allowed from")[0], level["claims"])
    rows = tables(page, "wrong", "growth")[0]
    for row, wrong in zip(rows, level["wrong"], strict=True):
        assert row["wrong"] == wrong["assumption"]
        expect(row["95 %"], wrong["in_95"] / wrong["captures"])
        expect(row["growth"], wrong["claimed_growth"])
        expect(row["error m"], wrong["median_error_m"])


def detection_numbers(page, path):
    found = read_json(path.with_name("detection.json"))
    levels = found["scenes"][0]["levels"]
    rows = tables(page, "photons", "area, presence")[0]
    for row, level in zip(rows, levels, strict=True):
        expect(row["photons"], level["photons"])
        expect(row["area, presence"], level["area_presence"])
        expect(row["area, false alarm"], level["area_false_alarm"])
        expect(row["reported with (95 %)"], level["reported_with"] / found["captures"])
    for table, level in zip(tables(page, "claim", "allowed from"), levels, strict=True):
        claims(table, level["false_alarms"])


def sweep_numbers(page, path):
    found = read_json(path.with_name("sweep.json"))
    rows = tables(page, "method", "varies", "time, first")[0]
    for row, ratio in zip(rows, found["ratios"], strict=True):
        assert row["method"] == ratio["method"]
        keys = [header for header in row if header.startswith("time, following")]
        expect(row[keys[0]], ratio["time"], ratio["time_low"], ratio["time_high"])
        expect(row["error (95 %)"], ratio["error"], ratio["error_low"], ratio["error_high"])
        expect(row["wall, following"], ratio["wall"])
        expect(row["captures"], ratio["captures"])
    rows = tables(page, "method", "photons", "median m")[0]
    methods = found["scenes"][0]["levels"][0]["methods"]
    for row, method in zip(rows, methods, strict=True):
        for header, key in (("median m", "median_m"), ("90 % m", "p90_m"), ("rms m", "rms_m"),
                            ("first ms", "first_cpu_ms"), ("next ms", "following_cpu_ms")):
            expect(row[header], method[key])


def calibration_numbers(page, path):
    found = read_json(path.with_name("instrument.json"))["parameters"]
    rows = tables(page, "parameter", "value", "its sigma")[0]
    for row, parameter in zip(rows, found, strict=True):
        assert row["parameter"] == parameter["name"]
        error = (parameter["standard_error"] or 0) * (100 if row["value"].endswith("%") else 1)
        expect(row["value"].replace("+-", ""), *[parameter["value"], error][: 1 + parameter["determined"]])


def error_rows(page, errors):
    rows = tables(page, "error", "mean absolute", "RMSE")[0]
    assert [row["error"] for row in rows] == list(errors)
    for row in rows:
        for header, key in (("mean absolute", "mean_absolute"), ("RMSE", "rmse"), ("median", "median"),
                            ("90 %", "p90")):
            expect(row[header], errors[row["error"]][key])


def training_numbers(page, path):
    error_rows(page, read_json(path.with_name("training.json"))["validation"]["errors"])


def network_numbers(page, path):
    error_rows(page, read_json(path.with_name("evaluation.json"))["errors"])


def study_numbers(page, path):
    """Each point that tells its values has them from one row of the table."""
    rows = [[factor * float(cell) for cell in row.values() if NUMBER.fullmatch(cell) for factor in (1, 1e3)]
            for row in read_csv(path.with_suffix(".csv"))]  # also in milliseconds and millimetres
    told = page.evaluate("[...document.querySelectorAll('circle title')].map(t => t.textContent)")
    assert len(told) >= 3
    for text in told:
        # "series\nx axis, unit: 1.2\ny axis, unit: 3.4"
        x, y = [Decimal(line.rpartition(": ")[2]) for line in text.splitlines()[-2:]]
        assert any(any(shows(x, v) for v in row) and any(shows(y, v) for v in row) for row in rows), text


def vehicles_numbers(page, path):
    worst = {}
    for row in read_csv(path.with_suffix(".csv")):
        key = f"{row['method']}, {1e3 * float(row['step_s']):g} ms"
        worst[key] = max(worst.get(key, 0), 1e3 * float(row["error_m"]))
    told = page.evaluate("[...document.querySelectorAll('circle title')].map(t => t.textContent)")
    told = [text for text in told if "worst error of the position, mm" in text]
    assert len(told) >= 3
    for text in told:
        name, below, _ = text.splitlines()[0].partition(", below")
        error = Decimal(text.rpartition(": ")[2])
        assert worst[name] <= 1e-6 if below else shows(error, worst[name]), text


def planner_numbers(page, path):
    told = page.evaluate("[...document.querySelectorAll('circle title')].map(t => t.textContent)")
    rows = [row for row in read_csv(path.with_suffix(".csv")) if row["length_cells"]]
    assert len(told) == len({row["variant"] for row in rows})
    for text in told:
        first, *axes = text.splitlines()
        name = first[:len(first) // 2 - 1].replace(",", "")  # it is the series and the point's label
        own = [row for row in rows if row["variant"] == name]
        x, y = [Decimal(line.rpartition(": ")[2]) for line in axes]
        # Both problems are among the longest. The table holds times of few digits.
        assert abs(float(x) - statistics.median(float(row["time_ms"]) for row in own)) <= 6e-4 + 5e-3 * float(x)
        assert shows(y, statistics.median(float(row["length_cells"]) / float(row["optimum_cells"]) for row in own))


def live_numbers(page, answers):
    """The numbers of one moment are those of the answer of the same time."""
    shown = facts(page)
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        lines = answers.read_text(encoding="utf-8").splitlines()[1:]
        same = [json.loads(line) for line in lines[:-1]]
        same = [answer for answer in same if shows(Decimal(shown["Time (s)"]), answer["time_s"])]
        if same:
            break
        time.sleep(0.1)
    assert len(same) == 1
    answer = same[0]
    mode = answer["modes"][0]
    expect(shown["Position (m)"], *mode["pose"][:2])
    expect(shown["Latency (ms)"], answer["latency_ms"])
    if ">" not in shown["Presence"]:
        expect(shown["Presence"], 100 * answer["presence_probability"])
    if answer["track"] and answer["track"]["velocity"]:
        expect(shown["Speed (m/s)"], math.hypot(*answer["track"]["velocity"]))


NUMBERS = {
    "fit": fit_numbers, "track": track_numbers, "scene": scene_numbers, "index": index_numbers,
    "evaluation": evaluation_numbers, "bound": bound_numbers, "stability": stability_numbers,
    "drive": drive_numbers, "side_by_side": side_by_side_numbers, "trials": trials_numbers,
    "plan": plan_numbers, "compare": compare_numbers, "coverage": coverage_numbers,
    "detection": detection_numbers, "sweep": sweep_numbers, "calibration": calibration_numbers,
    "training": training_numbers, "network": network_numbers,
    **{name: study_numbers for name in ("derivatives", "moving", "forward")},
    "planner": planner_numbers, "vehicles": vehicles_numbers,
}
