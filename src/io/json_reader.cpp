// SPDX-License-Identifier: Apache-2.0
#include "io/json_reader.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <set>

#include "blindcorner/forward/error.h"
#include "io/file_bytes.h"
#include "io/json_depth.h"

namespace blindcorner {
namespace {

using Json = JsonReader::Json;

/// Most errors that are noted. More say nothing new, as for a list of numbers in a wrong unit.
constexpr std::size_t kMaxErrors = 100;
/// Longest value that is quoted in a message, characters.
constexpr std::size_t kLongestQuote = 60;

/// Key as part of a path: quoted and escaped when it is not a plain name.
std::string path_part(const std::string& key) {
  const bool plain = !key.empty() && std::all_of(key.begin(), key.end(), [](unsigned char c) {
    return std::isalnum(c) != 0 || c == '_' || c == '-' || c == '$';
  });
  return plain ? key : Json(key).dump(-1, ' ', true, Json::error_handler_t::replace);
}

/// What the parser complains about, without its own prefix: "[...] parse error at line 3, column 7:
/// syntax error while ..." becomes "line 3, column 7: found what is not JSON (syntax error while
/// ...".
std::string syntax_message(const std::string& what) {
  std::string text = one_line(what);
  if (const auto bracket = text.find("] "); bracket != std::string::npos) {
    text.erase(0, bracket + 2);
  }
  std::string place;
  if (const std::string prefix = "parse error at "; text.starts_with(prefix)) {
    const auto colon = text.find(": ");
    place = text.substr(prefix.size(), colon - prefix.size()) + ": ";
    text.erase(0, colon == std::string::npos ? colon : colon + 2);
  }
  return place + "found what is not JSON (" + text + "), accepted: JSON";
}

/// Whether the parser stopped at a comment. `byte` is the last byte that it read, counted from 1.
bool begins_comment(const std::string& text, std::size_t byte) {
  if (byte == 0 || byte > text.size()) return false;
  const std::string_view rest = std::string_view(text).substr(byte - 1);
  return rest.starts_with("//") || rest.starts_with("/*") || rest.starts_with("#");
}

std::vector<std::string> to_strings(const std::vector<std::string_view>& words) {
  return {words.begin(), words.end()};
}

}  // namespace

JsonReader::JsonReader(const Json& document, std::string file)
    : JsonReader(&document, file, "", nullptr, JsonRecording::root_for(file)) {
  if (record_ != nullptr) record_->type = document.type();
}

Json JsonReader::parse(const std::string& text, const std::string& file) {
  check_json_depth(text, file);
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  std::string twice;
  const auto watch = [&](int /*depth*/, Json::parse_event_t event, Json& value) {
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && twice.empty()) {
      auto key = value.get<std::string>();
      if (!keys.back().insert(key).second) twice = std::move(key);
    }
    return true;
  };
  Json json;
  try {
    json = Json::parse(text, watch);
  } catch (const Json::parse_error& error) {
    throw Error(file, syntax_message(error.what()) +
                          (begins_comment(text, error.byte) ? " (it has no comments)" : ""));
  } catch (const Json::exception& error) {
    throw Error(file, syntax_message(error.what()));
  }
  if (!twice.empty()) {
    throw Error(file, path_part(twice) + ": found twice in one object, accepted: once");
  }
  return json;
}

void JsonReader::fail(const std::string& accepted) const { fail(found(), accepted); }

void JsonReader::fail(const std::string& found, const std::string& accepted) const {
  refuse("found " + found + ", accepted: " + accepted);
}

JsonReader JsonReader::noting(std::vector<std::string>& errors) const {
  return {json_, file_, path_, &errors, record_};
}

void JsonReader::attempt(const std::function<void()>& part) const {
  if (errors_ == nullptr) return part();
  try {
    part();
  } catch (const Error& error) {
    if (errors_->size() < kMaxErrors) errors_->emplace_back(error.what());
  }
}

void JsonReader::note(const std::string& found, const std::string& accepted) const {
  attempt([&] { fail(found, accepted); });
}

void JsonReader::refuse(const std::string& problem) const {
  throw Error(path_.empty() ? file_ : file_ + ": " + path_, problem);
}

std::string JsonReader::found() const {
  if (!present()) return "nothing";
  if (json_->is_number_float() && !std::isfinite(json_->get<double>())) {
    return "a number that is not finite";
  }
  std::string text = json_->dump(-1, ' ', true, Json::error_handler_t::replace);
  if (text.size() > kLongestQuote) text = text.substr(0, kLongestQuote - 3) + "...";
  return text;
}

JsonReader JsonReader::field(const std::string& key, const Json* value) const {
  return {value, file_, path_.empty() ? path_part(key) : path_ + "." + path_part(key), errors_,
          record_ == nullptr ? nullptr : &record_->field(key, value)};
}

JsonReader JsonReader::element(std::size_t index) const {
  const Json* value = &(*json_)[index];
  return {value, file_, path_ + "[" + std::to_string(index) + "]", errors_,
          record_ == nullptr ? nullptr : &record_->element(index, value)};
}

JsonReader JsonReader::at(std::string_view key) const {
  if (!is_object()) fail("an object");
  const auto it = json_->find(std::string(key));
  return field(std::string(key), it == json_->end() ? nullptr : &*it);
}

std::vector<std::pair<std::string, JsonReader>> JsonReader::fields() const {
  if (!is_object()) fail("an object");
  if (record_ != nullptr) record_->object = true;
  std::vector<std::pair<std::string, JsonReader>> list;
  for (const auto& item : json_->items()) {
    list.emplace_back(item.key(), field(item.key(), &item.value()));
  }
  return list;
}

void JsonReader::allow_only(const std::vector<std::string_view>& known) const {
  const std::vector<std::string> names = to_strings(known);
  looks_for(names);
  for (const auto& [key, value] : fields()) {
    if (std::ranges::find(names, key) != names.end() || (path_.empty() && key == "$schema")) {
      continue;
    }
    const std::string near = nearest_word(key, names);
    const std::string hint = near.empty() ? "" : " (did you mean \"" + near + "\"?)";
    value.note("an unknown field" + hint, list_words(names));
  }
}

void JsonReader::looks_for(const std::vector<std::string>& names) const {
  if (record_ != nullptr) record_->names = names;
}

bool JsonReader::decided_by(std::string_view key) const {
  const JsonReader field = at(key);
  if (field.record_ != nullptr) field.record_->decides = field.present() ? "there" : "absent";
  return field.present();
}

void JsonReader::exclude(std::string_view key, const std::string& accepted) const {
  const JsonReader field = at(key);
  if (field.record_ != nullptr) field.record_->forbidden = true;
  if (field.present()) field.fail(accepted);
}

std::string_view JsonReader::at_most_one_of(
    const std::vector<std::string_view>& alternatives) const {
  std::string_view chosen;
  for (const std::string_view name : alternatives) {
    const bool there = decided_by(name);
    const JsonReader field = at(name);
    if (field.record_ != nullptr) field.record_->deciders = list_words(to_strings(alternatives));
    if (!there) continue;
    if (!chosen.empty()) {
      field.fail("a field beside \"" + std::string(chosen) + "\"",
                 "only one of " + list_words(to_strings(alternatives)));
    }
    chosen = name;
  }
  return chosen;
}

std::string_view JsonReader::exactly_one_of(
    const std::vector<std::string_view>& alternatives) const {
  const std::string_view chosen = at_most_one_of(alternatives);
  if (chosen.empty()) {
    fail("none of these fields", "one of " + list_words(to_strings(alternatives)));
  }
  return chosen;
}

std::vector<JsonReader> JsonReader::elements(std::size_t smallest) const {
  if (!is_array() || json_->size() < smallest) {
    fail(smallest == 0   ? "an array"
         : smallest == 1 ? "an array of at least 1 element"
                         : "an array of at least " + std::to_string(smallest) + " elements");
  }
  if (record_ != nullptr) record_->array = true, record_->least = smallest;
  std::vector<JsonReader> list;
  for (std::size_t i = 0; i < json_->size(); ++i) list.push_back(element(i));
  return list;
}

std::vector<JsonReader> JsonReader::elements_exactly(std::size_t size,
                                                     const std::string& what) const {
  const std::string accepted = "an array of " + std::to_string(size) + " " + what;
  if (!is_array()) fail(accepted);
  if (json_->size() != size) fail("an array of " + std::to_string(json_->size()), accepted);
  if (record_ != nullptr) record_->size = size;
  return elements();
}

void JsonReader::record_number(const NumberRange& range, bool whole) const {
  if (record_ != nullptr) record_->number = range, record_->whole = whole;
}

void JsonReader::record_words(const std::vector<std::string_view>& words) const {
  if (record_ != nullptr) record_->words = to_strings(words);
}

double JsonReader::number(const NumberRange& range) const {
  record_number(range, false);
  if (!present() || !json_->is_number() || !range.contains(json_->get<double>())) {
    note(found(), range.text());
    return std::nan("");
  }
  return json_->get<double>();
}

int JsonReader::integer(int lower, int upper) const {
  const NumberRange range = NumberRange::between(lower, upper);
  record_number(range, true);
  if (!present() || !json_->is_number() || !range.contains(json_->get<double>()) ||
      std::floor(json_->get<double>()) != json_->get<double>()) {
    fail(range.text("a whole number"));
  }
  return static_cast<int>(json_->get<double>());
}

bool JsonReader::boolean() const {
  if (record_ != nullptr) record_->boolean = true;
  if (!present() || !json_->is_boolean()) {
    note(found(), "true or false");
    return false;
  }
  return json_->get<bool>();
}

std::string JsonReader::text() const {
  if (record_ != nullptr) record_->text = true;
  if (!is_string()) fail("a string");
  return json_->get<std::string>();
}

std::string JsonReader::word(const std::vector<std::string_view>& words) const {
  record_words(words);
  if (!is_string() ||
      std::find(words.begin(), words.end(), json_->get<std::string>()) == words.end()) {
    fail(list_words(to_strings(words)));
  }
  return json_->get<std::string>();
}

std::string JsonReader::deciding_word(const std::vector<std::string_view>& words) const {
  std::string chosen = word(words);
  if (record_ != nullptr) record_->decides = Json(chosen).dump();
  return chosen;
}

double JsonReader::number_or(double absent, const NumberRange& range) const {
  record_number(range, false);
  return present() ? number(range) : absent;
}

bool JsonReader::boolean_or(bool absent) const {
  if (record_ != nullptr) record_->boolean = true;
  return present() ? boolean() : absent;
}

std::string JsonReader::text_or(const std::string& absent) const {
  if (record_ != nullptr) record_->text = true;
  return present() ? text() : absent;
}

std::string JsonReader::word_or(const std::string& absent,
                                const std::vector<std::string_view>& words) const {
  record_words(words);
  return present() ? word(words) : absent;
}

std::string JsonReader::deciding_word_or(const std::string& absent,
                                         const std::vector<std::string_view>& words) const {
  std::string chosen = word_or(absent, words);
  if (record_ != nullptr) record_->decides = Json(chosen).dump();
  return chosen;
}

Eigen::Vector3d JsonReader::vector(const NumberRange& range) const {
  const auto parts = elements_exactly(3, "numbers");
  return {parts[0].number(range), parts[1].number(range), parts[2].number(range)};
}

Eigen::Quaterniond JsonReader::quaternion() const {
  const auto parts = elements_exactly(4, "numbers");
  const NumberRange component = NumberRange::between(-1.01, 1.01);
  const Eigen::Quaterniond q(parts[0].number(component), parts[1].number(component),
                             parts[2].number(component), parts[3].number(component));
  // A quaternion written by hand has few digits; a larger deviation is a mistake.
  if (std::abs(q.norm() - 1) > 1e-3) fail("a quaternion of length 1");
  return q.normalized();
}

std::pair<double, double> JsonReader::interval(const NumberRange& range) const {
  const auto parts = elements_exactly(2, "numbers");
  const std::pair<double, double> ends{parts[0].number(range), parts[1].number(range)};
  if (ends.first >= ends.second) note(found(), "[lower, upper] with lower < upper");
  return ends;
}

std::string list_choices(const std::vector<std::string>& choices) {
  std::string text;
  for (std::size_t i = 0; i < choices.size(); ++i) {
    if (i > 0) text += i + 1 == choices.size() ? " or " : ", ";
    text += choices[i];
  }
  return text;
}

std::string list_words(std::vector<std::string> words) {
  for (std::string& word : words) word = '"' + word + '"';
  return list_choices(words);
}

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

std::string nearest_word(std::string_view word, const std::vector<std::string>& known) {
  std::string nearest;
  std::size_t least = 1 + std::max<std::size_t>(2, word.size() / 3);
  for (const std::string& candidate : known) {
    // A name without its unit, or the other way round, is the likeliest slip.
    const bool stem =
        candidate.starts_with(std::string(word) + "_") || word.starts_with(candidate + "_");
    const std::size_t distance = stem ? 0 : edit_distance(word, candidate);
    if (distance < least) {
      least = distance;
      nearest = candidate;
    }
  }
  return nearest;
}

}  // namespace blindcorner
