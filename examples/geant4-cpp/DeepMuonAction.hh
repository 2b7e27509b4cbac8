// Primary muons from a DeepMuon model: one each event, downwards through a horizontal square.

#pragma once

#include <cstdint>
#include <string>

#include "G4Event.hh"
#include "G4SystemOfUnits.hh"
#include "G4VUserPrimaryGeneratorAction.hh"
#include "Randomize.hh"

#include "MuonGun.hh"
#include "deepmuon.hpp"

class DeepMuonAction : public G4VUserPrimaryGeneratorAction {
public:
    // The square has its centre at (0, 0, z). Muons come in at angles: one much larger than the detector loses none.
    DeepMuonAction(const std::string& model, G4double side, G4double z) : generator_(model), side_(side), z_(z) {}

    // The same with a family, which has any depth in its range, in metres of its medium.
    DeepMuonAction(const std::string& family, float depth, G4double side, G4double z)
        : generator_(family, depth), side_(side), z_(z) {}

    // All randomness is Geant4's: an event that is run again with its seeds has its muon again.
    void GeneratePrimaries(G4Event* event) override {
        const auto random = [] { return static_cast<std::uint32_t>(G4UniformRand() * 0x1p32); };
        const deepmuon::Muon muon = generator_.sample(1, random).front();
        const G4double x = (G4UniformRand() - 0.5) * side_, y = (G4UniformRand() - 0.5) * side_;
        gun_.Shoot(event, muon.charge > 0, muon.kinetic_energy * GeV, {muon.u, muon.v, muon.w}, {x, y, z_});
    }

    // The time in which so many muons come through the square, on average.
    G4double LiveTime(G4double muons) const {
        const G4double rate = std::stod(generator_.metadata("rate_hz_per_m2")) / (s * m2);
        return muons / (rate * side_ * side_);
    }

private:
    deepmuon::Generator generator_;
    MuonGun gun_;
    G4double side_, z_;
};
