within PositioningStage.Interfaces;
model NoCables "Null version: nothing pulls"
  extends PartialCables;
equation
  f = 0.0;
end NoCables;
