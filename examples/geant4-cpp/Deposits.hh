// What the events of a run, in one thread, leave in a detector.

#pragma once

#include "G4Event.hh"
#include "G4Step.hh"
#include "G4UserEventAction.hh"
#include "G4UserSteppingAction.hh"

// Sums up the energy that each event leaves in the detector.
class Deposits : public G4UserEventAction {
public:
    void BeginOfEventAction(const G4Event*) override { deposit_ = 0; }
    void Add(G4double energy) { deposit_ += energy; }
    void EndOfEventAction(const G4Event*) override {
        hits += deposit_ > 0;
        sum += deposit_;
    }

    inline static G4int hits = 0;
    inline static G4double sum = 0;

private:
    G4double deposit_ = 0;
};

class Steps : public G4UserSteppingAction {
public:
    // The detector is the volume of this name.
    Steps(Deposits& deposits, const G4String& name) : deposits_(deposits), name_(name) {}
    void UserSteppingAction(const G4Step* step) override {
        if (step->GetPreStepPoint()->GetPhysicalVolume()->GetName() == name_) {
            deposits_.Add(step->GetTotalEnergyDeposit());
        }
    }

private:
    Deposits& deposits_;
    G4String name_;
};
