// Primary muons from a DeepMuon model: one each event, which enters a box centred on the origin.

#pragma once

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <string>

#include "G4SystemOfUnits.hh"
#include "G4VUserPrimaryGeneratorAction.hh"
#include "Randomize.hh"

#include "MuonGun.hh"
#include "box.hpp"
#include "deepmuon.hpp"

class BoxAction : public G4VUserPrimaryGeneratorAction {
public:
    // The model is one of the flux through a sphere, which deepmuon-bake --surface sphere takes out of a family.
    BoxAction(const std::string& model, G4double x, G4double y, G4double z)
        : generator_(model), box_(x / m, y / m, z / m) {
        if (generator_.metadata("surface") != "1") {
            throw std::runtime_error(model + " has the muons of a plane; make it by deepmuon-bake --surface sphere");
        }
    }

    // All randomness is Geant4's: an event that is run again with its seeds has its muon again.
    void GeneratePrimaries(G4Event* event) override {
        const auto bits = [] { return static_cast<std::uint32_t>(G4UniformRand() * 0x1p32); };
        for (;;) {
            const deepmuon::Muon muon = generator_.sample(1, bits).front();
            const std::optional<deepmuon::Entry> entry = box_.enter(muon, [] { return G4UniformRand(); });
            ++tries_;
            if (entry) {
                gun_.Shoot(event, muon.charge > 0, muon.kinetic_energy * GeV, {muon.u, muon.v, muon.w},
                           {entry->x * m, entry->y * m, entry->z * m});
                return;
            }
        }
    }

    // The time in which the muons shot so far by this action, which is one thread's, hit the box, on average.
    G4double LiveTime() const {
        return tries_ / (std::stod(generator_.metadata("rate_hz_per_m2")) * box_.largest_area()) * s;
    }

private:
    deepmuon::Generator generator_;
    deepmuon::Box box_;
    MuonGun gun_;
    G4double tries_ = 0;
};
