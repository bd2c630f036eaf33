// SPDX-License-Identifier: Apache-2.0
/// Strict reading of JSON. Every value knows the path that leads to it. A wrong value gives one
/// line, `file: field.path[3]: found ..., accepted: ...`.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "forward/support/number_range.h"
#include "io/json_record.h"

namespace blindcorner {

/// A place in a JSON document, possibly empty. Cheap to copy; the document must outlive it.
class JsonReader {
 public:
  using Json = nlohmann::ordered_json;

  /// The document itself; `file` names it in messages.
  JsonReader(const Json& document, std::string file);

  /// The same place, where refusals are noted in `errors` as far as reading can go on. Refused
  /// numbers, truth values and unknown fields are noted at once, all others by the `attempt` around
  /// them.
  JsonReader noting(std::vector<std::string>& errors) const;
  /// Runs a part of the reading. If errors are noted, a refusal ends only this part.
  void attempt(const std::function<void()>& part) const;
  /// Number of errors noted so far. If a part of the reading added none, its values are sound.
  std::size_t noted() const { return errors_ == nullptr ? 0 : errors_->size(); }

  /// Parses a text. Throws Error with line and column for what is not JSON, and for a key that
  /// appears twice in one object.
  static Json parse(const std::string& text, const std::string& file);

  /// Refuses this value: `found` is what the value holds (or "nothing").
  [[noreturn]] void fail(const std::string& accepted) const;
  /// Refuses this value with other words for what was found.
  [[noreturn]] void fail(const std::string& found, const std::string& accepted) const;
  /// Refuses this value. `problem` itself says what was found and what is accepted.
  [[noreturn]] void refuse(const std::string& problem) const;

  bool present() const { return json_ != nullptr; }
  bool is_null() const { return present() && json_->is_null(); }
  bool is_array() const { return present() && json_->is_array(); }
  bool is_object() const { return present() && json_->is_object(); }
  bool is_string() const { return present() && json_->is_string(); }
  const Json& json() const { return *json_; }
  const std::string& file() const { return file_; }

  /// The same place with another value, for values that were completed from elsewhere.
  JsonReader with_value(const Json& value) const {
    return {&value, file_, path_, errors_, record_};
  }

  /// Field of an object; absent when the object has no such field. This must be an object.
  JsonReader at(std::string_view key) const;
  bool has(std::string_view key) const { return at(key).present(); }
  /// Like `has`, for a field whose presence decides which other fields may or must be there.
  bool decided_by(std::string_view key) const;
  /// Refuses a field that the fields beside it exclude; `accepted` says why.
  void exclude(std::string_view key, const std::string& accepted) const;
  /// Fields of an object in the order of the file.
  std::vector<std::pair<std::string, JsonReader>> fields() const;
  /// Refuses fields that are not in `known`, with the nearest known name as a suggestion. The
  /// document itself may also name its schema ("$schema").
  void allow_only(const std::vector<std::string_view>& known) const;
  /// Tells a record which fields may be there, if the caller itself refuses all others.
  void looks_for(const std::vector<std::string>& names) const;
  /// The one field of `alternatives` that is there; empty: none. Refuses several.
  std::string_view at_most_one_of(const std::vector<std::string_view>& alternatives) const;
  /// Like `at_most_one_of`, but one of the fields must be there.
  std::string_view exactly_one_of(const std::vector<std::string_view>& alternatives) const;

  /// Elements of an array with at least `smallest` elements.
  std::vector<JsonReader> elements(std::size_t smallest = 0) const;
  /// Elements of an array of exactly `size`; `what` completes "an array of 3 ...".
  std::vector<JsonReader> elements_exactly(std::size_t size, const std::string& what) const;

  /// NaN if the value is refused and errors are noted. Vectors and intervals then hold NaN, too.
  double number(const NumberRange& range = {}) const;
  int integer(int lower, int upper) const;
  bool boolean() const;
  std::string text() const;
  /// One of the given words.
  std::string word(const std::vector<std::string_view>& words) const;
  /// Like `word`, for a word that decides which fields may or must stand beside this one.
  std::string deciding_word(const std::vector<std::string_view>& words) const;
  Eigen::Vector3d vector(const NumberRange& range = {}) const;
  /// [w, x, y, z] of length 1 but for rounding, normalised.
  Eigen::Quaterniond quaternion() const;
  /// [lower, upper] with lower < upper.
  std::pair<double, double> interval(const NumberRange& range = {}) const;

  /// The same, with a default for a field that is absent.
  double number_or(double absent, const NumberRange& range = {}) const;
  bool boolean_or(bool absent) const;
  std::string text_or(const std::string& absent) const;
  std::string word_or(const std::string& absent, const std::vector<std::string_view>& words) const;
  std::string deciding_word_or(const std::string& absent,
                               const std::vector<std::string_view>& words) const;

 private:
  JsonReader(const Json* json, std::string file, std::string path, std::vector<std::string>* errors,
             JsonRecord* record)
      : json_(json),
        file_(std::move(file)),
        path_(std::move(path)),
        errors_(errors),
        record_(record) {}

  /// Refuses the value, or notes the refusal if errors are noted.
  void note(const std::string& found, const std::string& accepted) const;
  void record_number(const NumberRange& range, bool whole) const;
  void record_words(const std::vector<std::string_view>& words) const;

  JsonReader element(std::size_t index) const;
  JsonReader field(const std::string& key, const Json* value) const;
  std::string found() const;

  const Json* json_;  ///< null: the field is absent
  std::string file_;
  std::string path_;
  std::vector<std::string>* errors_ = nullptr;
  JsonRecord* record_ = nullptr;  ///< what is asked of this place; null: it is not recorded
};

/// `a, b or c`.
std::string list_choices(const std::vector<std::string>& choices);
/// `"a", "b" or "c"`.
std::string list_words(std::vector<std::string> words);

/// Characters to insert, delete or replace (Levenshtein).
std::size_t edit_distance(std::string_view a, std::string_view b);

/// The word of `known` that is most like `word`, or an empty string when none is like it.
std::string nearest_word(std::string_view word, const std::vector<std::string>& known);

}  // namespace blindcorner
