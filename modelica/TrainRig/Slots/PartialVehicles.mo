within TrainRig.Slots;
partial model PartialVehicles "Slot: from a value of each vehicle to the one that acts"
  parameter Integer n = 2 "Vehicles";
  input Real u[n] "Values as given";
  output Real y[n] "Values that act, in the same unit";
end PartialVehicles;
