within CascadedTanks;
package Effects "What tanks, pump and sensor may do beside the nominal model"
end Effects;
