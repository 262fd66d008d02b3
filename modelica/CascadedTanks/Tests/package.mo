within CascadedTanks;
package Tests "Claims that the models must hold"
end Tests;
