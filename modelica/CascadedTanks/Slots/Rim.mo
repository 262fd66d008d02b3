within CascadedTanks.Slots;
model Rim "Null version: the tank is high enough"
  extends PartialRim;
equation
  leaves = 0.0;
  caught = 0.0;
end Rim;
