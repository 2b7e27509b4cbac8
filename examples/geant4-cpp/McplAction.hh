// Primary muons from an MCPL file of deepmuon-gen, with their places and times: event number i has the i-th.

#pragma once

#include <cstdint>
#include <string>

#include "G4Event.hh"
#include "G4RunManager.hh"
#include "G4SystemOfUnits.hh"
#include "G4VUserPrimaryGeneratorAction.hh"

#include "MuonGun.hh"
#include "mcpl.h"

class McplAction : public G4VUserPrimaryGeneratorAction {
public:
    explicit McplAction(const std::string& path) : file_(mcpl_open_file(path.c_str())) {}
    ~McplAction() override { mcpl_close_file(file_); }
    McplAction(const McplAction&) = delete;
    McplAction& operator=(const McplAction&) = delete;

    // In any thread the same; after the last muon the run ends.
    void GeneratePrimaries(G4Event* event) override {
        const auto number = static_cast<std::uint64_t>(event->GetEventID());
        if (number >= Muons()) {
            G4RunManager::GetRunManager()->AbortRun(true);
            return;
        }
        if (number != mcpl_currentposition(file_)) {
            mcpl_seek(file_, number);
        }
        const mcpl_particle_t& muon = *mcpl_read(file_);
        const auto vector = [](const double* axes) { return G4ThreeVector(axes[0], axes[1], axes[2]); };
        gun_.Shoot(event, muon.pdgcode < 0, muon.ekin * MeV, vector(muon.direction), vector(muon.position) * cm,
                   muon.time * ms);
    }

    std::uint64_t Muons() const { return mcpl_hdr_nparticles(file_); }

    // The time that all muons of the file stand for, if they hit a target; else below 0.
    G4double LiveTime() const { return mcpl_hdr_stat_sum(file_, "deepmuon_live_time_s") * s; }

private:
    mcpl_file_t file_;
    MuonGun gun_;
};
