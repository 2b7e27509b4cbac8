#pragma once

#include <cstdint>
#include <cstring>
#include <string>

namespace deepmuon {

// The stream that keeps a model's random numbers apart from those of all others, the FNV-1a hash of what the model says
// of itself: docs/random_numbers.md has it as a formula.
inline std::uint64_t model_stream(const std::string& architecture, const std::string& flux, const std::string& medium,
                                  const std::string& surface, float depth) {
    std::string description = architecture + "/" + flux + "/" + medium + "/" + surface + "/";
    std::uint32_t bits;
    static_assert(sizeof bits == sizeof depth, "a float is to have four bytes");
    std::memcpy(&bits, &depth, sizeof bits);
    for (int shift = 0; shift < 32; shift += 8) {
        description += static_cast<char>(bits >> shift & 0xff);
    }
    std::uint64_t stream = 0xcbf29ce484222325;
    for (const char byte : description) {
        stream = (stream ^ static_cast<unsigned char>(byte)) * 0x100000001b3;
    }
    return stream;
}

// The flux of a model that does not name it: its creator's name, without the version.
inline std::string creator(const std::string& created_by) {
    const std::string name = created_by.substr(0, created_by.find_first_of("0123456789"));
    return name.substr(0, name.find_last_not_of(' ') + 1);
}

} // namespace deepmuon
