within TrainRig.Parts;
connector Flange "Coupling point of a vehicle"
  Real v(unit="m/s") "Speed, positive forward";
  flow Real f(unit="N") "Cut force acting on the component, positive forward";
end Flange;
