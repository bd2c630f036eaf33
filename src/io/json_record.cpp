// SPDX-License-Identifier: Apache-2.0
#include "io/json_record.h"

#include <algorithm>
#include <iterator>

namespace blindcorner {
namespace {

using Json = JsonRecord::Json;

thread_local const JsonRecording* active = nullptr;

std::string pointer_part(std::string_view name) {
  std::string part = "/";
  for (const char c : name) part += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
  return part;
}

}  // namespace

JsonRecord& JsonRecord::field(std::string_view name, const Json* value) {
  object = true;
  auto it = std::ranges::find(fields, name, [](const auto& f) { return f.first; });
  if (it == fields.end()) {
    fields.emplace_back(name, JsonRecord{});
    it = std::prev(fields.end());
    it->second.pointer = pointer + pointer_part(name);
  }
  if (value != nullptr) it->second.type = value->type();
  return it->second;
}

JsonRecord& JsonRecord::element(std::size_t index, const Json* value) {
  while (elements.size() <= index) {
    elements.emplace_back();
    elements.back().pointer = pointer + "/" + std::to_string(elements.size() - 1);
  }
  JsonRecord& item = *std::next(elements.begin(), static_cast<std::ptrdiff_t>(index));
  item.type = value->type();
  return item;
}

const JsonRecord* JsonRecord::find(std::string_view name) const {
  const auto it = std::ranges::find(fields, name, [](const auto& f) { return f.first; });
  return it == fields.end() ? nullptr : &it->second;
}

void JsonRecord::observe(const Json& content) {
  type = content.type();
  if (content.is_number()) number = NumberRange{}, whole = content.is_number_integer();
  boolean = content.is_boolean();
  text = content.is_string();
  array = content.is_array();
  object = content.is_object();
  for (std::size_t i = 0; array && i < content.size(); ++i) {
    element(i, &content[i]).observe(content[i]);
  }
  if (!object) return;
  for (const auto& item : content.items()) {
    field(item.key(), &item.value()).observe(item.value());
    names.push_back(item.key());
  }
}

JsonRecording::JsonRecording(JsonRecord& root, std::string file)
    : root_(root), file_(std::move(file)) {
  active = this;
}

JsonRecording::~JsonRecording() { active = nullptr; }

JsonRecord* JsonRecording::root_for(const std::string& file) {
  return active != nullptr && active->file_ == file ? &active->root_ : nullptr;
}

}  // namespace blindcorner
