within PositioningStage;
package Effects "Catalogue: what the nominal stage leaves out"
  annotation (Documentation(info="<html>
<p>What matters: half a newton, a hundredth of the forces at constant speed (some 45 N), at 0.1 m/s where
it depends on the speed.</p>
</html>"));
end Effects;
