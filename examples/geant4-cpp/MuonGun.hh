// Shoots one muon.

#pragma once

#include "G4Event.hh"
#include "G4MuonMinus.hh"
#include "G4MuonPlus.hh"
#include "G4ParticleGun.hh"
#include "G4ThreeVector.hh"

class MuonGun {
public:
    void Shoot(G4Event* event, G4bool positive, G4double energy, G4ThreeVector direction, G4ThreeVector place,
               G4double time = 0) {
        if (positive) {
            gun_.SetParticleDefinition(G4MuonPlus::Definition());
        } else {
            gun_.SetParticleDefinition(G4MuonMinus::Definition());
        }
        gun_.SetParticleEnergy(energy);
        gun_.SetParticleMomentumDirection(direction);
        gun_.SetParticlePosition(place);
        gun_.SetParticleTime(time);
        gun_.GeneratePrimaryVertex(event);
    }

private:
    G4ParticleGun gun_{1};
};
