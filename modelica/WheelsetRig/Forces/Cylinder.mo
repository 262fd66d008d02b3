within WheelsetRig.Forces;
model Cylinder "Hydraulic cylinder with a load cell"
  extends SpringDamper;
  Units.Force reading = F "Load cell: force along n on the body at frame_b";
end Cylinder;
