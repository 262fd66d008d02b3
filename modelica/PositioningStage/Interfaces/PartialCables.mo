within PositioningStage.Interfaces;
partial model PartialCables "Slot: what pulls at the carriage by its position"
  input Real position(unit="m") "Of the carriage";
  output Real f(unit="N") "Against a motion to greater positions";
end PartialCables;
