within TrainRig.Slots;
partial model PartialBogies "Slot: from a value of each bogie to the one that acts"
  parameter Integer n = 4 "Bogies";
  input Real u[n](each unit="Pa") "Measured pressures";
  input Real restBefore[n](each unit="Pa") "Readings of empty cylinders, from earlier in a chain";
  input Real heldBefore[n](each unit="Pa") "Readings while the brake is applied, likewise";
  output Real y[n](each unit="Pa") "Pressures that act";
  output Real rest[n](each unit="Pa") "What sensors read of empty cylinders";
  output Real held[n](each unit="Pa") "What they read while the brake is applied";
end PartialBogies;
